from dataclasses import replace

from dnet.recorders.step_text import describe_step
from tests.recorders.rollout import frames, step


def test_a_step_is_one_line_in_millimetres() -> None:
    seen = frames(2)
    turn = replace(step(seen[0], seen[-1]), chamfer=0.00123)
    line = describe_step(turn, 4)
    assert line.startswith("step 4: Chamfer 1.23 mm, motion ")
    assert line.endswith("mm, plan straight")


def test_it_says_why_a_plan_falls_short_and_nothing_of_none() -> None:
    seen = frames(2)
    turn = step(seen[0], seen[-1])
    assert turn.plan is not None
    short = replace(turn, plan=replace(turn.plan, status="partial", reason="out of reach"))
    assert describe_step(short, 0).endswith("plan partial (out of reach)")
    assert "plan" not in describe_step(replace(turn, plan=None), 0)
