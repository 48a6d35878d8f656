"""The diagram of the documentation shows the imports as they are."""

from tests.architecture import PICTURE, imports, layers, picture, reduced


def test_the_diagram_agrees_with_the_imports() -> None:
    drawn = PICTURE.read_text(encoding="utf-8")
    now = picture(layers(), reduced(imports()))
    assert drawn == now, "run `python -m tests.architecture`"


def test_no_arrow_leads_up() -> None:
    level = {part: number for number, row in enumerate(layers()) for part in row}
    assert all(level[one] < level[other] for one, other in imports())


def test_an_import_that_follows_from_others_is_not_drawn() -> None:
    edges = {("a", "b"), ("b", "c"), ("a", "c"), ("a", "d")}
    assert reduced(edges) == {("a", "b"), ("b", "c"), ("a", "d")}
