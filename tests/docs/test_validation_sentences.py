"""The figures in the text of docs/validation.md's section on MuJoCo, against the record of the run that made it."""

from __future__ import annotations

import json
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_figures_in_the_engine_section_match_the_record() -> None:
    text = " ".join((ROOT / "docs" / "validation.md").read_text().split())
    q = json.loads((ROOT / "docs" / "validation.json").read_text())["groups"]["engine"]["quoted"]
    for sentence in sentences(q):
        assert sentence in text, f"not in docs/validation.md: {sentence}"


def sentences(q: dict[str, float]) -> list[str]:
    """Find what the text says in figures."""
    return [*programme_sentences(q), *range_sentences(q), *square_sentences(q)]


def span(values: list[float], digits: int = 1) -> str:
    return f"{min(values):.{digits}f} to {max(values):.{digits}f}"


def programme_sentences(q: dict[str, float]) -> list[str]:
    modes, best = ("2 modes", "3 modes", "4 modes"), "foreshortened, 3 modes"
    programmes = ("doublet", "bang_bang", "multi_sine", "spin_up", "release", "payload")
    within = [sum(q[f"{p}, {m}, rms"] < 1.0 for p in programmes) for m in (best, "foreshortened, 4 polynomials")]
    jumps = [
        [q[f"{p}, {k}, 3 modes, rms"] for p in programmes[:2] + programmes[5:]] for k in ("linear", "foreshortened")
    ]
    assert within == [3, 4]
    return [
        f"{span([q[f'multi_sine, linear, {m}, rms'] for m in modes])} mm off (r.m.s.) under the multi-sine and "
        f"{span([q[f'spin_up, linear, {m}, rms'] for m in modes])} mm under the spin-up",
        f"With foreshortening it is {q['multi_sine, foreshortened, 2 modes, rms']:.2f} mm with 2 modes and "
        f"{q[f'multi_sine, {best}, rms']:.2f} mm with 3",
        f"is {span(jumps[0])} mm off, the foreshortened one {min(jumps[1]):.2f} to {max(jumps[1]):.1f} mm",
        f"{q[f'release, {best}, rms']:.0f} mm with 3 modes and foreshortening, "
        f"{q['release, foreshortened, 3 polynomials, rms']:.1f} mm with 3 polynomials",
        f"where links bend by {q['twice spin_up, bend']:.1f} %, it is up to "
        f"{span([q[f'twice spin_up, linear, {m}, maximum'] for m in modes], 0)} mm off",
        f"with 3 modes up to {q[f'twice spin_up, {best}, maximum']:.2f} mm",
    ]


def range_sentences(q: dict[str, float]) -> list[str]:
    def limit(model: str, kind: str, tolerance: int = 10) -> float:
        return q[f"limit, {model}, {kind}, {tolerance} mm"]

    jump, release, linear = "torques that jump", "release", "linear, 2 modes"
    two, three, polynomials = (f"foreshortened, {n}" for n in ("2 modes", "3 modes", "3 polynomials"))
    assert f"limit, {two}, smooth torques, 10 mm" not in q, "within it all over the range"
    assert f"limit, {three}, {jump}, 50 mm" not in q
    assert all(q[f"spin, {m}, {bend}, 10 mm"] == 1.0 for m in (two, three) for bend in ("hardly bent", "bent by 5 %"))
    assert not any(f"spin, {m}, unstable from" in q for m in (two, three)), "stable up to 10"
    of_linear = min(limit(linear, kind) for kind in (jump, "smooth torques"))
    at_50_mm = min(limit(linear, kind, 50) for kind in (jump, "smooth torques"))
    bent, straight, unstable = (
        q[f"spin, {linear}, {name}"] for name in ("bent by 5 %, 10 mm", "hardly bent, 10 mm", "unstable from")
    )
    rad = q["first clamped"]
    smooth, jumps = (int(q[f"tried, {kind}"]) for kind in ("smooth torques", jump))
    return [
        f"put the limit at {q['critical spin']:.3f} of it, and the linear model with 2 modes, whose shapes make it "
        f"stiffer, at {unstable:.3f}",
        f"| up to {of_linear:.0f} % of a link | bent by 5 % up to {bent:.1f} ({rad * bent:.1f} rad/s), "
        f"hardly bent up to {straight:.2f} ({rad * straight:.1f} rad/s); "
        f"unstable from {unstable:.2f} ({rad * unstable:.1f} rad/s) | 50 mm up to {at_50_mm:.0f} %",
        f"| {limit(two, jump):.1f} %; smooth torques beyond {smooth} % | up to 1, the largest tried; stable up to 10 "
        f"| 50 mm up to {limit(two, jump, 50):.0f} %",
        f"| {limit(three, jump):.1f} %; smooth torques beyond {smooth} % | up to 1; stable up to 10 "
        f"| 50 mm beyond {min(smooth, jumps)} %",
        f"| {limit(linear, release):.1f} % with 2 clamped-free modes, {limit(three, release):.1f} % with 3 and "
        "foreshortening | "
        f"| take polynomials: {limit(polynomials, release):.1f} % with 3",
    ]


def square_sentences(q: dict[str, float]) -> list[str]:
    def of(model: str, name: str, driver: str = "agent") -> float:
        return q[f"square, {driver}, {model}, {name}"]

    linear, better, best = "linear, 2 modes", "foreshortened, 2 modes", "foreshortened, 3 polynomials"
    flips = [of(f"{kinematics}, 3 polynomials", "torque change") for kinematics in ("foreshortened", "linear")]
    assert min(flips) > 200.0
    lost = [0.1 * of(f"{kinematics}, 3 polynomials", "rms") for kinematics in ("foreshortened", "linear")]
    two_modes = "chain, 1 % of two modes, 17.5 % of the others, 20 elements"
    every = [f"chain, 1 % of every mode, {n} elements" for n in (10, 20)]

    def both(model: str) -> str:
        return f"{of(model, 'score'):.1f} / {of(model, 'score_after_2s'):.1f} mm"

    scores = [f"{of(m, 'score'):.1f} mm" for m in (linear, "chain", better)]
    later = [f"{of(m, 'score_after_2s'):.1f} mm" for m in (linear, "chain", better)]
    return [
        f"the links bend by up to {q['square, bend']:.0f} % under the agent, and already the rigid arm's reference "
        f"turns a link at up to {q['reference, largest']:.1f} rad/s, above {0.1 * q['first clamped']:.1f} rad/s for "
        f"{100.0 * q['reference, share']:.0f} % of the lap",
        f"off by up to {0.1 * of(linear, 'maximum'):.0f} cm there.** Under the agent the linear model with 2 modes is "
        f"{of(linear, 'rms'):.0f} mm from the chain (r.m.s.) and {of(linear, 'maximum'):.0f} mm at most",
        f"its tip is up to {of(linear, 'kinematics, maximum'):.0f} mm off",
        f"With foreshortening and 2 modes it is {of(better, 'rms'):.1f} mm and {of(better, 'maximum'):.0f} mm",
        f"scores {scores[0]} over the lap and {later[0]} after 2 s on the linear model with 2 modes, "
        f"{scores[2]} and {later[2]} with foreshortening, {scores[1]} and {later[1]} on the chain",
        f"others by 17.5 %, it scores {both(two_modes)}, {of(two_modes, 'rms'):.1f} mm from the reference",
        f"it scores {both(every[0])} with 10 elements and {both(every[1])} with 20",
        f"its torque changes by {of(every[0], 'torque change'):.0f} and "
        f"{of(every[1], 'torque change'):.0f} N m a period, "
        f"where it changes by {of('chain, 20 elements', 'torque change'):.1f} N m on the reference",
        f"the two are {of(every[0], 'modal, rms'):.0f} mm apart (r.m.s.)",
        f"The model with 2 modes is {of(linear, 'modal, rms'):.0f} mm from the finer one, with foreshortening "
        f"{of(better, 'modal, rms'):.0f} mm",
        f"FLSAC's tip is {of(linear, 'rms', 'flsac'):.0f} mm from the chain's (r.m.s.) on the linear model "
        f"with 2 modes and {of(better, 'rms', 'flsac'):.0f} mm with foreshortening, "
        f"but {of(best, 'rms', 'flsac'):.0f} mm with",
        f"{lost[0]:.0f} to {lost[1]:.0f} cm from the chain",
        f"with 2 modes it changes by {of(linear, 'torque change'):.0f} N m",
    ]
