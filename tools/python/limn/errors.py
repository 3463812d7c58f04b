"""What limn raises; the text is that of the command line."""

from typing import Any


class InputError(ValueError):
    """Bad input: what is wrong, where (file:line:col), what is known there."""


class UnknownParameterError(InputError, KeyError):
    """A name that no parameter of the scene has; the text lists the nearest."""

    __str__ = Exception.__str__  # KeyError would quote the text


class NonFiniteError(ArithmeticError):
    """Samples came out infinite or not a number; they count as zero in `result`."""

    result: Any = None
