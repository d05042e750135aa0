"""A notebook that is executed as Jupyter does, with a kernel of its own."""

import os

import nbformat
import pytest
from nbclient import NotebookClient

CELLS = (
    "import mpp_taichi as mpp\n"
    "from mpp_taichi.simulation import notebook_progress\n"
    "result = mpp.run('kepler', samples=400, backend='cpu')\n"
    "result",
    "notebook_progress.FIRST_SECONDS = notebook_progress.SECONDS = 0.0\n"
    "lines, shown = [], notebook_progress.CellProgress.line\n"
    "notebook_progress.CellProgress.line = lambda self, simulation: lines.append(shown(self, simulation)) or lines[-1]\n"
    "again = mpp.Simulation('kepler', backend='cpu')\n"
    "_ = again.run(duration=1.0, every=0.25, call=lambda simulation: None)",
    "print(lines[-1])",
)


@pytest.fixture(scope="module")
def outputs():
    """What each cell shows: lists of nbformat's outputs."""
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(text) for text in CELLS])
    # With this variable, a kernel would not look at what libraries in C write to standard error.
    environment = {key: value for key, value in os.environ.items() if key != "PYTEST_CURRENT_TEST"}
    NotebookClient(notebook, timeout=300, kernel_name="python3").execute(env=environment)
    return [cell["outputs"] for cell in notebook["cells"]]


@pytest.mark.sampled(3)
def test_a_result_is_shown_as_the_page_that_plays_it_and_nothing_in_red(outputs):
    *progress, shown = outputs[0]  # on a busy machine the run is long enough to show its progress
    assert [each["data"]["text/html"] for each in progress] in ([], [""])
    html = shown["data"]["text/html"]
    assert shown["output_type"] == "execute_result" and "image/png" in shown["data"]
    assert html.startswith('<figure><iframe srcdoc="&lt;!DOCTYPE html&gt;') and 'sandbox="allow-scripts"' in html
    assert "status  ok" in html and "data:image/png;base64," in html and "<script" not in html


def test_progress_is_one_line_that_goes_away(outputs):
    (line,) = outputs[1]
    assert line["output_type"] == "display_data" and line["data"]["text/html"] == ""
    said = outputs[2][0]["text"]
    assert "%, t = " in said and "steps/s" in said


def test_no_cell_writes_to_standard_error(outputs):
    assert [each for cell in outputs for each in cell if each.get("name") == "stderr"] == []
