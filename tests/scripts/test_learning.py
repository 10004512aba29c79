"""`python -m scripts.learning`: the pages have what the committed data give."""

from pathlib import Path

import pytest
from matplotlib import pyplot as plt

from scripts.common.markdown import DOCS, shown_blocks
from scripts.learning.__main__ import STUDIES


@pytest.mark.parametrize("name", STUDIES)
def test_the_pages_have_what_the_data_say(name: str, tmp_path: Path) -> None:
    study = STUDIES[name]
    agents = study.results(tmp_path, 1)
    for block, tabulate in study.tables.items():
        assert tabulate(agents) == shown_blocks()[block]
    for picture, draw in study.pictures.items():
        figure = draw(agents)
        assert all(axis.lines for axis in figure.axes)
        plt.close(figure)
        assert (DOCS / "figures" / f"{picture}.png").is_file()
