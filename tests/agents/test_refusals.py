"""What the command `flexarm` refuses: at once, in a line, with a status that says whose fault it is."""

from pathlib import Path

import numpy as np
import pytest

from flexarm_env import FlexibleArm
from tests.support.shell import Shell

MODULE = """
class Needs:
    def __init__(self, gain):
        self.predict = None

def spoilt(observation):
    return [float("nan")] * 2

number = 7
"""
ALONE = "--no-baselines --no-shipped"
BAD = [  # status 1, and what the line says after "error: "
    ("show Sqare-v0", "environment = 'Sqare-v0': must be one of 'FlexArm/Carry-v0', "),
    ("evaluate nobody", "policy 'nobody': neither a file or folder nor a known name; shipped "),
    ("evaluate --laps 0", "laps = 0: must be an integer >= 1"),
    (f"evaluate {ALONE}", "policies: nothing to score"),
    ('evaluate --no-baselines --options {"noize":1}', "FlexArmEnv.__init__() got an unexpected keyword argument 'noi"),
    (f"evaluate mine:Needs {ALONE}", "policy mine:Needs: needs a classmethod for_env(env), or no arguments"),
    (f"evaluate mine:spoilt {ALONE}", "mine:spoilt: action[0] = nan: must be finite"),
    (f"evaluate mine:number {ALONE}", "mine:number: policy = 7: must have predict(observation)"),
    (f"evaluate mine:nothing {ALONE}", "'mine:nothing': mine has no attribute nothing"),
    (f"evaluate mine: {ALONE}", "'mine:': must be 'module:attribute'"),
    (f"evaluate elsewhere:thing {ALONE}", "No module named 'elsewhere'"),
    ("evaluate --policy square --sweep noises", "sweep = 'noises': must be one of 'nominal', "),
    ("evaluate --sweep noise", "policies: nothing to sweep"),
    ("evaluate --policy square --sweep noise --laps 3", "arm, laps, seed, own, pool: the board sets them"),
    ("leaderboard --rows nobody", "entries = 'nobody': must be one of 'ifdc'"),
    ("leaderboard --columns colour", "columns = 'colour': must be one of 'nominal'"),
    ("leaderboard --jobs 0", "jobs = 0: must be an integer >= 1"),
    ("leaderboard --without nobody", "without = 'nobody'"),
    ("leaderboard --entries ifdc --output run.npz", "output = run.npz/leaderboard.json: must be in a folder"),
    ("play --delay 999", "delay = 999.0: must be a finite number and >= 0.0 and <= 200.0 [ms]"),
    ("replay run.npz --output x.png --time 9", "time = 9.0: must be a finite number"),
    ("replay run.npz --time 1", "time = 1 s: is for a .png file, see --output"),
    ("replay run.npz --output x.gif --fps 30", "fps = 30: must be one of 1, 2, 4, 5, 10, 20, 25, 50 for"),
    ("render nobody", "policy 'nobody'"),
    ("render ifdc --output x.avi", "output's suffix = '.avi': must be one of '.png', '.gif', '.mp4'"),
    ("render ifdc --output folder.png", "output = folder.png: is a folder"),
    ("render ifdc --output x.png --time -1", "time = -1.0: must be a finite number and >= 0.0 [s]"),
    ("render ifdc --output x.gif --time 1", "time = 1 s: is for .png files"),
    ("render ifdc --save folder.npz", "save = folder.npz: is a folder"),
    ("render ifdc --fps 0", "fps = 0: must be an integer from 1 to 100"),
    ("render ifdc --speed 0", "speed = 0.0: must be a finite number"),
    ("render ifdc --size 5", "size = 5: must be an integer from 64"),
    ("render ifdc --seed -1", "seed = -1: must be an integer >= 0"),
    ("render ifdc --fps 100 --speed 0.01", "fps = 100 at speed = 0.01: makes 160001 pictures of 16 s;"),
]
WRONG = [  # status 2, and what the last line says after the verb and "error: "
    ("", "the following arguments are required: VERB"),
    ("trian", "argument VERB: invalid choice: 'trian'"),
    ("show", "the following arguments are required: ID"),
    ("list 7", "unrecognized arguments: 7"),
    ("evaluate --options {", "argument --options: {: not JSON"),
    ("evaluate square --stable-baselines3 PPO", "--stable-baselines3: there is no zip file among the policies"),
    ("evaluate square --vec-normalize none", "--vec-normalize: there is no zip file among the policies"),
    ("evaluate square --environment Reach-v0 --own", "--own: cannot go with --environment"),
    ('evaluate square --arm paper --options {"arm":"linear"}', "--arm: cannot go with an arm among --options"),
    ("evaluate --policy square --sweep noise --baselines", "--baselines: cannot go with --sweep"),
    ("evaluate --policy square --sweep noise --shipped", "--shipped: cannot go with --sweep"),
    ("leaderboard --submitit {", "argument --submitit: {: not JSON"),
    ("render ifdc --save x.txt", "--save: must end in .npz, got "),
    ("render ifdc --stable-baselines3 PPO", "--stable-baselines3: there is no zip file"),
    ("train --batch 7", "batch = 7: must divide"),
    ('train --options {"noize":1}', "Settings.__init__() got an unexpected keyword argument 'noize'; did you mean 'no"),
    ("train --algorithm sac --clip 0.2", "unrecognized arguments: --clip 0.2"),
    ("train --epochs many", "argument --epochs: invalid int value: 'many'"),
    ("train --lesson-options []", "argument --curriculum-options: []: must be a JSON object"),
    ("train --epoch 3", "unrecognized arguments: --epoch 3; did you mean --epochs?"),
]


@pytest.mark.parametrize(
    ("line", "code", "message"),
    [(line, code, message) for code, cases in ((1, BAD), (2, WRONG)) for line, message in cases],
)
def test_bad_input_ends_with_a_line(
    flexarm: Shell, monkeypatch: pytest.MonkeyPatch, line: str, code: int, message: str
) -> None:
    """Nothing is begun, and nothing is written."""
    verb, *arguments = line.split() or [""]
    if verb in ("play", "render", "replay"):
        pytest.importorskip("pygame")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    monkeypatch.setattr("flexarm_agents.commands.render.episode", lambda *given: pytest.fail("the episode was run"))
    monkeypatch.setattr("sys.dont_write_bytecode", True)
    Path("mine.py").write_text(MODULE)
    for name in ("folder.png", "folder.npz"):
        Path(name).mkdir()
    FlexibleArm().record(np.linspace(0.0, 0.5, 51), np.zeros((51, 16)), np.zeros((51, 2))).save("run.npz")
    before = set(flexarm.folder.iterdir())
    told = flexarm(*filter(None, [verb]), *arguments, status=code).stderr
    *former, last = told.splitlines()
    if code == 1:
        assert last.startswith(f"error: {message}")
        assert all(" is now " in one for one in former)  # a former name
    else:
        known = f"flexarm {verb}" if arguments or verb in ("list", "show") else "flexarm"
        assert last.startswith(f"{known}: error: {message}")
        assert f"usage: {known}" in told
    assert set(flexarm.folder.iterdir()) == before
