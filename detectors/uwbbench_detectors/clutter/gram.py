"""Dominant shapes of a window of frames from the small matrix of its frames' products, where that is safe.

With the window ``X = U S V^H`` the matrix ``G = X X^H = U S^2 U^H`` has one row a frame, whatever the number of taps.
Its eigenvalues are squares, so that singular values below 1e-8 of the largest drown in rounding, and the shapes of
close ones mix. Whether that matters for the shapes wanted is not guessed but bounded, for every window anew.
"""

from __future__ import annotations

import numpy as np

from uwbbench.api import ComplexArray, compiled

EPSILON = float(np.finfo(np.float64).eps)
SHRINKS = 0.75
"""An iteration goes on while it takes the residual at least down to this share."""
ROUNDING = 4 * EPSILON
"""Residual over energy that rounding alone leaves, and no iteration takes away."""
DEGREE = 4
"""Of the polynomial that one iteration amounts to."""
ENERGY_RANGE = (1e-130, 1e130)
"""Energies whose squares neither over- nor underflow."""


@compiled
def _add_scaled(total: ComplexArray, part: ComplexArray, factor: complex) -> None:
    for place in range(len(total)):
        total[place] += part[place] * factor


@compiled
def _add_scaled_conjugate(total: ComplexArray, part: ComplexArray, factor: complex) -> None:
    for place in range(len(total)):
        total[place] += part[place].conjugate() * factor


@compiled
def _product(left: ComplexArray, right: ComplexArray) -> complex:
    """``left^H right``."""
    total = 0j
    for place in range(len(left)):
        total += left[place].conjugate() * right[place]
    return total


@compiled
def _orthonormalize(vectors: ComplexArray) -> None:
    """Gram and Schmidt's, twice, on the rows; a row of zeros becomes NaN."""
    for row in range(len(vectors)):
        for _ in range(2):
            for earlier in range(row):
                _add_scaled(vectors[row], vectors[earlier], -_product(vectors[earlier], vectors[row]))
            scale = 1 / np.sqrt(_product(vectors[row], vectors[row]).real)
            for place in range(len(vectors[row])):
                vectors[row, place] *= scale


@compiled
def _multiply(gram: ComplexArray, vectors: ComplexArray, image: ComplexArray) -> None:
    """Products of the matrix with each row of ``vectors``."""
    image[:] = 0
    for row in range(len(vectors)):
        for place in range(len(gram)):
            _add_scaled_conjugate(image[row], gram[place], vectors[row, place])


@compiled
def _damp(gram: ComplexArray, basis: ComplexArray, image: ComplexArray, rest: float) -> None:
    """Put the basis through the Chebyshev polynomial that is at most 1 on the eigenvalues from 0 to ``rest``.

    ``T_0 = 1``, ``T_1 = x``, ``T_(k+1) = 2 x T_k - T_(k-1)`` with ``x = 2 G / rest - 1``. Above ``rest`` no polynomial
    of that degree grows faster; powers of G grow far less where the next eigenvalue is not small.

    Parameters
    ----------
    basis : (rank, frames) array
        Replaced.
    image : (rank, frames) array
        The matrix times the basis; overwritten.
    """
    rank, frames = basis.shape
    before = np.empty((rank, frames), np.complex128)
    for row in range(rank):
        for place in range(frames):
            before[row, place] = basis[row, place]
            basis[row, place] = (2 / rest) * image[row, place] - basis[row, place]
    for _ in range(DEGREE - 1):
        _multiply(gram, basis, image)
        for row in range(rank):
            for place in range(frames):
                after = (4 / rest) * image[row, place] - 2 * basis[row, place] - before[row, place]
                before[row, place], basis[row, place] = basis[row, place], after


@compiled
def _bounds(small: ComplexArray, energy: float, squares: float, frames: int) -> tuple[float, float]:
    """Lower bound of the eigenvalues that a basis holds, and upper bound of all others."""
    lowest, held, held_squares = np.inf, 0.0, 0.0
    for row in range(len(small)):
        radius = 0.0
        for column in range(len(small)):
            held_squares += small[row, column].real ** 2 + small[row, column].imag ** 2
            if column != row:
                radius += abs(small[row, column])
        held += small[row, row].real
        lowest = min(lowest, small[row, row].real - radius)
    others = np.sqrt(max(squares - held_squares, 0.0) + frames**2 * EPSILON * squares)
    return lowest, min(max(energy - held, 0.0) + frames * EPSILON * energy, others)


@compiled
def enter_frame(frame: ComplexArray, slot: int, window: ComplexArray, turned: ComplexArray, gram: ComplexArray) -> None:
    """Put a frame into a slot of the window and renew the slot's row and column of ``X X^H``.

    Every entry is a product of two frames of the window, whatever was there before, so that no error builds up.

    Parameters
    ----------
    frame : (taps,) array
    slot : int
    window : (frames, taps) array
        X.
    turned : (taps, frames) array
        Its transpose.
    gram : (frames, frames) array
    """
    for tap in range(len(frame)):
        window[slot, tap] = turned[tap, slot] = frame[tap]
    row = gram[slot]
    row[:] = 0
    for tap in range(len(frame)):
        _add_scaled_conjugate(row, turned[tap], frame[tap])
    for other in range(len(row)):
        gram[other, slot] = row[other].conjugate()


@compiled
def refine(gram: ComplexArray, window: ComplexArray, turned: ComplexArray, shapes: ComplexArray, angle: float) -> bool:
    """Turn shapes that are nearly the dominant ones into those, if it can be shown that this succeeds.

    Orthogonal iteration ``U <- orth(p(G) U)`` starts at ``X V`` with the shapes given, such as those of the frame
    before, and goes on while the residual ``R = G U - U H``, ``H = U^H G U``, shrinks; the polynomial p is G itself
    until a Chebyshev polynomial is known to be better. The angle between the span found and that of the true dominant
    vectors is then at most

        ``(|R| + e) / (h - r - 2 e) + W eps sqrt(tr G / h)``

    with the least eigenvalue ``h`` of ``H`` (by Gershgorin's circles), an upper bound ``r`` on all eigenvalues of ``G``
    that are not held (the smaller of ``tr G - tr H`` and ``sqrt(|G|^2 - |H|^2)``), and the rounding error ``e = (W + T)
    eps tr G`` of the products of W frames of T taps (Davis and Kahan, SIAM J. Numer. Anal. 7(1), 1970). The second term
    is the rounding of ``V = X^H U``. As ``h > r``, no other invariant subspace passes for the dominant one. Close
    values inside the span do no harm. Refused are windows whose next singular value is close to the last one wanted,
    whose last one wanted is far below the largest, and energies that over- or underflow when squared.

    Parameters
    ----------
    gram, window, turned : arrays
        As :func:`enter_frame` leaves them; frames not yet there are zero.
    shapes : (rank, taps) array
        Orthonormal rows near the dominant right singular vectors of the window; replaced by them on success.
    angle : float
        Largest angle in radians allowed between their span and the true one.

    Returns
    -------
    bool
        Whether ``shapes`` hold the dominant ones. If not, they are unchanged.
    """
    frames, taps = window.shape
    rank = len(shapes)
    energy, squares, weights = 0.0, 0.0, np.zeros(frames)
    for row in range(frames):
        energy += gram[row, row].real
        for place in range(frames):
            weights[place] += gram[row, place].real ** 2 + gram[row, place].imag ** 2
    for weight in weights:
        squares += weight
    if not ENERGY_RANGE[0] < energy < ENERGY_RANGE[1]:
        return False
    basis = np.zeros((rank, frames), np.complex128)
    for shape in range(rank):
        for tap in range(taps):
            _add_scaled(basis[shape], turned[tap], shapes[shape, tap])
    _orthonormalize(basis)

    image, small = np.empty((rank, frames), np.complex128), np.empty((rank, rank), np.complex128)
    residual = np.inf
    while True:
        previous, residual = residual, 0.0
        _multiply(gram, basis, image)
        for shape in range(rank):
            for other in range(rank):
                small[other, shape] = _product(basis[other], image[shape])
            for place in range(frames):
                left = image[shape, place]
                for other in range(rank):
                    left -= basis[other, place] * small[other, shape]
                residual += left.real**2 + left.imag**2
        residual = np.sqrt(residual)
        lowest, rest = _bounds(small, energy, squares, frames)
        if not residual < SHRINKS * previous or residual <= ROUNDING * energy:
            break
        if rest < lowest:
            _damp(gram, basis, image, rest)
        else:
            for shape in range(rank):
                for place in range(frames):
                    basis[shape, place] = image[shape, place]
        _orthonormalize(basis)

    rounding = (taps + frames) * EPSILON * energy
    gap = lowest - rest - 2 * rounding
    if not gap > 0:
        return False
    if not (residual + rounding) / gap + frames * EPSILON * np.sqrt(energy / lowest) <= angle:
        return False
    shapes[:] = 0
    for shape in range(rank):
        for row in range(frames):
            _add_scaled_conjugate(shapes[shape], window[row], basis[shape, row])
    _orthonormalize(shapes)
    return True
