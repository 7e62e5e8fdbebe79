"""Errors, each one line that says what is wrong: a refusal, a compiler, a difference from JAX."""


class TranslationError(Exception):
    """Any error of this package."""


class Unsupported(TranslationError, ValueError):
    """The refusal of a function that has no translation: a primitive, a type of numbers, a shape or
    a name that C cannot have.
    """


class CompilerFailure(TranslationError, RuntimeError):
    """A failure of the C compiler, or a library of it that cannot be loaded."""


class Mismatch(TranslationError, RuntimeError):
    """Results of a program in C that are not those of its JAX function."""


def require(holds: object, name: str, value: object, bound: str) -> None:
    """Raise Unsupported(`name = value is not possible: it must be {bound}.`) unless a condition
    holds.

    Args:
        holds: The condition.
        name: Name of the value.
        value: The value.
        bound: The bound in words.
    """
    if not holds:
        raise Unsupported(f"{name} = {value} is not possible: it must be {bound}.")
