"""What a step of the servo loop says to people."""

from dataclasses import asdict

import numpy as np

from dnet.types import Step


def describe_step(step: Step, index: int) -> str:
    """Return one line on what a step saw and did."""
    motion = 1e3 * float(np.linalg.norm(step.motion))
    text = f"step {index}: Chamfer {1e3 * step.chamfer:.2f} mm, motion {motion:.1f} mm"
    if step.plan is not None:
        text += f", plan {step.plan.status}"
        text += f" ({step.plan.reason})" if step.plan.reason else ""
    return text


def describe_latency(step: Step) -> str:
    """Return how long the stages of a step took, to go behind its description."""
    if step.latency is None:
        return ""
    stages = ", ".join(f"{name} {value:.0f}" for name, value in asdict(step.latency).items())
    return f" ({stages} ms)"
