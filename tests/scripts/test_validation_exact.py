"""What the validation compares frequencies with: exact beams and finite elements (their agreement: `make validate`)."""

from __future__ import annotations

import numpy as np
import pytest

from flexarm_env import ArmParameters


def test_a_straight_locked_arm_is_one_beam() -> None:
    """Roots from tables: 1.875104, 4.694091 clamped-free; 3.926602, 7.068583 pinned-free."""
    from scripts.validation.reference_models.exact_beams import Joints, two_links

    scale = np.sqrt(1676.0 / 0.335) / 9.0**2
    for joints, roots in (
        (Joints(shoulder=True, elbow=True), (1.875104, 4.694091)),
        (Joints(shoulder=False, elbow=True), (3.926602, 7.068583)),
    ):
        found = two_links(ArmParameters.linear(), 0.0, joints).frequencies(2, joints.free)
        np.testing.assert_allclose(found, scale * np.square(roots), rtol=1e-6)


def test_a_link_whose_root_cannot_move_across_it_is_pinned() -> None:
    """At 90 degrees the elbow moves along link 2 only."""
    from scripts.validation.reference_models.exact_beams import Joints, links, pinned_free, two_links

    expected = pinned_free(links(ArmParameters.linear())[1], 1)[0]
    found = two_links(ArmParameters.linear(), 0.5 * np.pi, Joints(shoulder=True, elbow=False)).frequencies(2, 1)
    assert found[1] == pytest.approx(expected, rel=1e-12)


def test_no_frequency_is_missed_where_two_coincide() -> None:
    """Two equal beams without connection have every frequency twice."""
    from scripts.validation.reference_models.exact_beams import Structure, links, pinned_free, single_link

    beam = links(ArmParameters.linear())[0]
    ((_, ends),) = single_link(beam, pinned=True).parts
    still = np.zeros_like(ends)
    pair = Structure(((beam, np.hstack([ends, still])), (beam, np.hstack([still, ends]))), np.zeros((6, 6)))
    np.testing.assert_allclose(pair.frequencies(4, 2), np.repeat(pinned_free(beam, 2), 2), rtol=1e-12)


def test_motions_that_break_the_frame_are_refused() -> None:
    from scripts.validation.reference_models.exact_beams import Joints
    from scripts.validation.reference_models.finite_elements import frame

    mesh = frame(ArmParameters.linear(), 1.0, Joints(shoulder=False, elbow=False), 4)
    with pytest.raises(ValueError, match="conditions"):
        mesh.held_to(np.ones((len(mesh.mass), 1)), 1, 0)
