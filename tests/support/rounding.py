"""A product and a sum that are rounded once, as recorded kernels round them."""

from fractions import Fraction


def rounded_once(a: float, b: float, c: float) -> float:
    return float(Fraction(float(a)) * Fraction(float(b)) + Fraction(float(c)))
