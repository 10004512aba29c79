"""Small linear algebra on sequences of numbers, written out entry by entry (see `dynamics`).

A symmetric matrix is held by its lower triangle, row by row.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

Vector = Sequence[Any]
Matrix = Sequence[Sequence[Any]]


def dot(a: Vector, b: Vector, start: Any = 0.0) -> Any:
    """Return `start` plus the products, added one by one: a fused multiply-add takes as long as an addition."""
    total = start
    for x, z in zip(a, b, strict=True):
        total = total + x * z
    return total


def plus_scaled(a: Vector, factor: Any, b: Vector) -> list[Any]:
    """Return ``a + factor b``."""
    return [x + factor * z for x, z in zip(a, b, strict=True)]


def place(i: int, j: int) -> int:
    """Return where entry (i, j) of a symmetric matrix lies in its lower triangle."""
    return max(i, j) * (max(i, j) + 1) // 2 + min(i, j)


def symmetric_times(lower: Vector, b: Vector) -> list[Any]:
    """Return the product of a symmetric matrix and a vector."""
    n = len(b)
    return [dot([lower[place(i, j)] for j in range(n)], b) for i in range(n)]


def products(b: Vector) -> list[Any]:
    """Return b_i b_j for a lower triangle, those off the diagonal twice: ``b^T A b`` is their dot with A."""
    return [b[i] * b[i] if i == j else 2.0 * (b[i] * b[j]) for i in range(len(b)) for j in range(i + 1)]


def inverse(lower: Vector, n: int) -> list[Any]:
    """Return the inverse of a positive definite n x n matrix; both by their lower triangles."""
    factors = factor([[lower[place(i, j)] for j in range(n)] for i in range(n)])
    columns = [solve(factors, [float(i == j) for i in range(n)]) for j in range(n)]
    return [columns[j][i] for i in range(n) for j in range(i + 1)]


class Factors(NamedTuple):
    """L and d of M = L diag(d) L^T.

    Attributes:
        lower: L below its diagonal of ones, row by row.
        inverse: 1/d.
    """

    lower: Vector
    inverse: Vector


def factor(matrix: Matrix) -> Factors:
    """Factorise a positive definite matrix, without pivoting."""
    n = len(matrix)
    lower: list[list[Any]] = [[0.0] * n for _ in range(n)]
    scaled: list[list[Any]] = [[0.0] * n for _ in range(n)]  # L diag(d)
    inverse: list[Any] = []
    for i in range(n):
        for j in range(i):
            scaled[i][j] = less(matrix[i][j], scaled[i][:j], lower[j][:j])
            lower[i][j] = scaled[i][j] * inverse[j]
        inverse.append(1.0 / less(matrix[i][i], scaled[i][:i], lower[i][:i]))
    return Factors([x for i, row in enumerate(lower) for x in row[:i]], inverse)


def solve(factors: Factors, right: Vector) -> list[Any]:
    """Return x with M x = right."""
    n = len(right)
    lower = [factors.lower[i * (i - 1) // 2 :][:i] for i in range(n)]
    x: list[Any] = []
    for i in range(n):
        x.append(less(right[i], lower[i], x))
    x = [value * scale for value, scale in zip(x, factors.inverse, strict=True)]
    for i in reversed(range(n)):
        later = range(n - 1, i, -1)  # in the order in which they are known
        x[i] = less(x[i], [lower[j][i] for j in later], [x[j] for j in later])
    return x


def less(start: Any, a: Vector, b: Vector) -> Any:
    """Subtract the products of two vectors from a number, one by one: only one operation waits for the last factor."""
    for x, z in zip(a, b, strict=True):
        start = start - x * z
    return start


def flat(fields: Iterable[Any]) -> list[Any]:
    """Return all numbers of fields that are numbers or sequences, in order."""
    return [x for field in fields for x in (field if isinstance(field, tuple | list) else [field])]


def unflat(numbers: Sequence[Any], sizes: Sequence[int | None]) -> Iterator[Any]:
    """Return the inverse of `flat`: fields of given lengths; None for a number."""
    source = iter(numbers)
    for size in sizes:
        yield next(source) if size is None else tuple(next(source) for _ in range(size))


def extent(sizes: Sequence[int | None]) -> int:
    """Return how many numbers fields of these lengths hold; see `unflat`."""
    return sum(1 if size is None else size for size in sizes)
