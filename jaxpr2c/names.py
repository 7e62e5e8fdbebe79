"""Names from outside that become names in C, and in C++, which reads the headers.

A program's own names begin with `_`, or with `op_` where all functions see them; no name from
outside does.
"""

import ctypes
import errno
import re

from jaxpr2c.errors import require
from jaxpr2c.scalars import FUNCTIONS

_PLAIN = re.compile("[A-Za-z][A-Za-z0-9_]*")
_WORDS = """
alignas alignof and and_eq asm auto bitand bitor bool break case catch char class co_await
co_return co_yield compl concept const const_cast consteval constexpr constinit continue decltype
default delete do double dynamic_cast else enum explicit export extern false float for friend goto
if inline int long mutable namespace new noexcept not not_eq nullptr operator or or_eq private
protected public register reinterpret_cast requires restrict return short signed sizeof static
static_assert static_cast struct switch template this thread_local throw true try typedef typeid
typename typeof typeof_unqual union unsigned using virtual void volatile while xor xor_eq

assert complex errno fpclassify i386 imaginary isfinite isgreater isgreaterequal isinf isless
islessequal islessgreater isnan isnormal isunordered jmp_buf linux main math_errhandling noreturn
offsetof setjmp signbit stderr stdin stdout unix va_arg va_copy va_end va_list va_start

BUFSIZ CHAR_BIT CLOCKS_PER_SEC DECIMAL_DIG DOMAIN EHWPOISON EOF FILE HUGE I INFINITY L_tmpnam NAN
NDEBUG NULL OVERFLOW PLOSS SING TLOSS UNDERFLOW WEOF
"""
"""Keywords of C and C++; macros and types of their libraries, in small letters and in capitals."""
_FAMILIES = """
op_\\w*
u?int(\\w*\\d|max|ptr)_t
(char8|char16|char32|clock|div|double|fenv|fexcept|float|fpos|imaxdiv|ldiv|lldiv)_t
(max_align|mbstate)_t
(off|ptrdiff|sig_atomic|size|ssize|time|wchar|wctrans|wctype|wint)_t
((U|S)?(CHAR|INT|LONG|LLONG|SHRT)|U?INT\\w*|FILENAME|FOPEN|MB_\\w+|NAME|PATH)_(C|MAX|MIN)
(PTRDIFF|RAND|S?SIZE|SIG_ATOMIC)_(C|MAX|MIN)
(TMP|WCHAR|WINT)_(MAX|MIN)
((DBL|EXIT|FE|FLT|FP|LC|LDBL|M|MATH|SEEK|SIG)_\\w+|(PRI|SCN)[a-zX]\\w+|SIG[A-Z0-9]+|HUGE_VAL[FL]?)
"""
"""Patterns of the program's own names, and of more types and macros."""
_TAKEN = re.compile(
    "|".join([*_WORDS.split(), *_FAMILIES.split(), *filter(str.isupper, vars(errno)), *FUNCTIONS])
)


def is_taken(word: str) -> bool:
    """Check whether C, C++ or a program itself has a name, so that no argument can have it."""
    return bool(_TAKEN.fullmatch(word))


def require_name(kind: str, word: str, is_public: bool = False) -> None:
    """Refuse, by Unsupported, a word that cannot be a name in C, a public one also if the C
    library has it.
    """
    free = _PLAIN.fullmatch(word) and not is_taken(word)
    free = free and not (is_public and hasattr(ctypes.CDLL(None), word))
    bound = (
        "letters, digits and _ that begin with a letter, not with op_, and mean nothing in C "
        "and C++"
    )
    require(free, kind, repr(word), f"{bound}: choose another")
