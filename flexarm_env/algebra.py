"""Small linear algebra on sequences of numbers, written out entry by entry (see `dynamics`).

A symmetric matrix is held by its lower triangle, row by row.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

Vector = Sequence[Any]
Matrix = Sequence[Sequence[Any]]


def dot(a: Vector, b: Vector) -> Any:
    """Sum of products, in order."""
    total: Any = 0.0
    for x, z in zip(a, b, strict=True):
        total = total + x * z
    return total


def place(i: int, j: int) -> int:
    """Where entry (i, j) of a symmetric matrix lies in its lower triangle."""
    return max(i, j) * (max(i, j) + 1) // 2 + min(i, j)


def symmetric_times(lower: Vector, b: Vector) -> list[Any]:
    """Product of a symmetric matrix and a vector."""
    n = len(b)
    return [dot([lower[place(i, j)] for j in range(n)], b) for i in range(n)]


def products(b: Vector) -> list[Any]:
    """b_i b_j for each entry of a lower triangle, those off the diagonal twice: ``b^T A b`` is their dot with A."""
    return [b[i] * b[i] if i == j else 2.0 * (b[i] * b[j]) for i in range(len(b)) for j in range(i + 1)]


def factor(matrix: Matrix) -> tuple[list[list[Any]], list[Any]]:
    """L and 1/d of M = L diag(d) L^T, without pivoting (M is positive definite)."""
    n = len(matrix)
    lower: list[list[Any]] = [[0.0] * n for _ in range(n)]
    scaled: list[list[Any]] = [[0.0] * n for _ in range(n)]  # L diag(d)
    inverse: list[Any] = []
    for i in range(n):
        for j in range(i):
            scaled[i][j] = matrix[i][j] - dot(scaled[i][:j], lower[j][:j])
            lower[i][j] = scaled[i][j] * inverse[j]
        inverse.append(1.0 / (matrix[i][i] - dot(scaled[i][:i], lower[i][:i])))
    return lower, inverse


def solve(factors: tuple[list[list[Any]], list[Any]], right: Vector) -> list[Any]:
    """x with M x = right, from `factor`."""
    lower, inverse = factors
    n = len(right)
    x: list[Any] = []
    for i in range(n):
        x.append(right[i] - dot(lower[i][:i], x))
    x = [value * scale for value, scale in zip(x, inverse, strict=True)]
    for i in reversed(range(n)):
        x[i] = x[i] - dot([lower[j][i] for j in range(i + 1, n)], x[i + 1 :])
    return x
