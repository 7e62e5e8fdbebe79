"""The public names, and where each is from: for type checkers, and for `__init__.py`, which imports
what is used.
"""

from jaxpr2c.compiler import CompiledProgram as CompiledProgram
from jaxpr2c.compiler import has_compiler as has_compiler
from jaxpr2c.errors import CompilerFailure as CompilerFailure
from jaxpr2c.errors import Mismatch as Mismatch
from jaxpr2c.errors import TranslationError as TranslationError
from jaxpr2c.errors import Unsupported as Unsupported
from jaxpr2c.parity import check_program as check_program
from jaxpr2c.program import Program as Program
from jaxpr2c.translator import translate as translate
