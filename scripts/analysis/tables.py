"""Results of the analysis -> Markdown tables."""

from typing import Any

from scripts.common.markdown import table

Results = dict[str, Any]  # of a study's trials, by their labels


def zeros_by_model(results: Results) -> str:
    """Tabulate the slowest right-half-plane zero and the bandwidth limit that follows."""
    head = ["arm", "right-half-plane zero [rad/s]", "at the tip it is", "bandwidth for a peak of 2 [rad/s]"]
    head += ["least peak for errors of 10 % up to 12.3 rad/s", "another zero comes from infinity at d [m]"]
    body = []
    for r in results["zeros"]["by_model"]:
        zero = f"{r['zero']:.2f}", {1: "single", 2: "double"}[r["multiplicity"]]
        entries = ", ".join(f"{s:.2f}" for s in r["entries"]) or "none: they are there at every d"
        body.append([r["arm"], *zero, f"{r['bandwidth']:.1f}", f"{r['peak']:.2f}", entries])
    return table(head, body)


def passivity(results: Results) -> str:
    """Tabulate which paths are positive real."""
    body = []
    for r in results["passivity"]["rows"]:
        least = ("yes", "0 or more") if r["worst"] > -1e-9 else ("**no**", f"{r['worst']:.2f} at {r['at']:.0f}")
        body.append([r["path"], *least, "" if r["negative_from"] is None else f"{r['negative_from']:.1f}"])
    head = ["path", "positive real", "least eigenvalue over norm, at [rad/s]", "below -0.01 from [rad/s] on"]
    return table(head, body)


def _time(seconds: float | None) -> str:
    if seconds is None:
        return "none"
    return f"{1e3 * seconds:.1f}" if seconds > 0.02 else f"{1e3 * seconds:.3g}"


def margins_claim(results: Results) -> str:
    """Write the claim about margins as a paragraph."""
    rows = results["linear"]["room"]
    late = {delayed: [r for r in rows if r["delayed"] == delayed] for delayed in ("position", "position+rate")}
    assert all(r["least"] > 1.0 for r in late["position"]), "stable with late positions"
    assert all(r["most"] < 1.0 for r in late["position+rate"]), "unstable with late rates"
    room = min(r["least"] for r in late["position"]), max(r["most"] for r in late["position"])
    paper = [r for r in late["position+rate"] if r["arm"] == "paper's arm"]
    groups = paper, late["position+rate"]
    own, every = ((1.0 / max(r["most"] for r in one), 1.0 / min(r["least"] for r in one)) for one in groups)
    return (
        "**With late positions and current rates the paper's loops are stable**, at practically every gain. They would "
        "stay so with\n"
        f"{room[0]:.1f} times the paper's delay in the worst case, {room[1]:.1f} times in the best. **With late rates "
        "they are unstable**:\n"
        f"the paper's delays are {own[0]:.1f} to {own[1]:.0f} times too long on the paper's arm, "
        f"and {every[0]:.1f} to {every[1]:.0f} times\n"
        "over both arms and all three sensors.\n"
    )


def margins_by_modes(results: Results) -> str:
    """Tabulate what late rates leave with more modes."""
    rows = results["linear"]["by_modes"]
    body = [[str(r["modes"]), _time(r["corner"]), _time(r["mid-side"])] for r in rows]
    return table(["modes a link", "delay margin, corner [ms]", "delay margin, mid-side [ms]"], body)


def simulated(results: Results) -> str:
    """Write how near to the linear margins the simulated loop begins to diverge, as a sentence."""
    keys = ("sensor", "delayed", "controller")
    linear = {tuple(r[k] for k in keys): r for r in results["linear"]["rows"] if r["arm"] == "paper's arm"}
    off = []
    for r in (r for name, r in results.items() if name != "linear"):
        for place in ("corner", "mid-side"):
            margin = linear[tuple(r[k] for k in keys)][place]["delay_margin"]
            off.append(max(abs(end / margin - 1.0) for end in r[place]))
    return (
        "Held in place and pushed a little, the nonlinear simulation begins to diverge\n"
        f"within {100.0 * max(off):.1f} % of the linear margin in all {len(off)} cases.\n"
    )


def largest_gains(results: Results) -> str:
    """Tabulate the largest stable lambda."""
    body = []
    for r in results["linear"]["largest_gains"]:
        body.append([r["what"], *(f"{r[at]:.2g}" if r[at] else "none" for at in ("corner", "mid-side"))])
    return table(["loop", "largest stable lambda, corner", "mid-side"], body)
