"""Worker: asks cases of places in a process of its own, which a driver may crash; `python -m mpp_taichi.verify.worker`."""

from typing import Any

from mpp_taichi.compare.answering import answer_lines
from mpp_taichi.verify.case_result import examine
from mpp_taichi.verify.catalogue import cases
from mpp_taichi.verify.place import Place


def main() -> None:
    """Answer lines `{"do": "ask", "case": …, "backend": …, "precision": …, "threads": …}` until standard input ends."""
    known = {each.name: each for each in cases()}

    def answer(line: dict[str, Any]) -> dict[str, Any]:
        place = Place(line["backend"], line["precision"], line["threads"])
        return examine(known[line["case"]], place).facts()

    answer_lines(answer)


if __name__ == "__main__":
    main()
