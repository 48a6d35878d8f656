"""Minimising the elastic energy over the free nodes, compiled: preconditioned L-BFGS.

The method of Liu, Bouaziz and Kavan 2017 (Quasi-Newton Methods for Real-Time Simulation of
Hyperelastic Materials, algorithm 1): limited-memory BFGS whose first guess of the Hessian is one
constant matrix for each coordinate, factorised beforehand, and a line search that halts at
Armijo's condition.
"""

from typing import NamedTuple, no_type_check

import numpy as np
from jaxtyping import Float64, Int64

from dnet.compiled import compiled
from dnet.sim.elastic_energy import Components, Elements, energy_and_gradient
from dnet.sim.envelope import Envelope, solve

ARMIJO = 1e-4
"""Share of the promised decrease that a step must bring."""
ROUNDING = 1e-13
"""Changes of the energy, relative to it, that mean nothing."""
FLAT = 1e-10
"""Cosine between a step and its change of the gradient below which it is not remembered."""
SHORTENINGS = 20
"""Tries of the line search."""
MEMORY = 8
"""Steps that the approximation of the Hessian remembers."""


class Memory(NamedTuple):
    """The latest steps and what they did to the gradient, in a ring."""

    steps: Float64[np.ndarray, "m 3 _"]
    changes: Float64[np.ndarray, "m 3 _"]
    """Of the gradient, over each step."""
    inverse: Float64[np.ndarray, "m"]
    """One over the scalar product of step and change."""
    cursor: Int64[np.ndarray, "2"]
    """How many are filled, and which is next."""


class Limits(NamedTuple):
    """When to stop a minimisation."""

    tolerance: float
    """Done when the next step would move no node farther, in metres."""
    patience: int
    """Given up after so many iterations."""


class Descent(NamedTuple):
    """How a minimisation ended."""

    converged: bool
    iterations: int
    residual: float
    """Length of the next step of the node that it would move farthest, in metres."""


def empty_memory(free: int) -> Memory:
    """Return a memory of no steps, for a number of free nodes."""
    ring = (MEMORY, 3, free)
    return Memory(np.zeros(ring), np.zeros(ring), np.zeros(MEMORY), np.zeros(2, dtype=np.int64))


@compiled
@no_type_check
def minimise(
    points: Components,
    body: Elements,
    stiffness: Envelope,
    memory: Memory,
    limits: Limits,
) -> tuple[bool, int, float]:
    """Move the free nodes to the nearest minimum of the energy.

    Args:
        points: Where all nodes are; the first ones, as many as the stiffness has rows, are free.
        body: Mesh and material.
        stiffness: The first guess of the Hessian for each coordinate, factorised.
        memory: Carried on from one call to the next.
        limits: When to stop.

    Returns:
        The fields of a `Descent`, bare: where Ctrl-C comes while a kernel runs, numba crashes in
        making a named tuple of them.
    """
    free = stiffness.first.shape[0]
    gradient = np.empty_like(points)
    step = np.empty((3, free))
    tried = points.copy()
    tried_gradient = np.empty_like(points)
    energy = energy_and_gradient(points, body, gradient)
    iterations = 0
    while True:
        descend(gradient, stiffness, memory, step)
        residual = farthest(step)
        # Written so that NaN does not pass for convergence.
        if not residual >= limits.tolerance:
            return residual < limits.tolerance, iterations, residual
        if iterations >= limits.patience:
            return False, iterations, residual

        slope = inner(gradient, step)
        share = 1.0
        accepted = False
        for _ in range(SHORTENINGS if slope < 0 else 0):
            add(points, share, step, tried)
            tried_energy = energy_and_gradient(tried, body, tried_gradient)
            excess = tried_energy - energy - share * slope
            if excess <= (ARMIJO - 1) * share * slope + ROUNDING * abs(energy):
                accepted = True
                break
            # The minimum of the parabola through what is known.
            least = -slope * share * share / (2 * excess)
            share = min(max(least, 0.1 * share), 0.5 * share)
        if not accepted:
            if memory.cursor[0] == 0:
                return False, iterations, residual
            memory.cursor[0] = 0  # The remembered curvature misleads: begin anew.
            continue

        k = memory.cursor[1]
        add(tried, -1.0, points, memory.steps[k])
        add(tried_gradient, -1.0, gradient, memory.changes[k])
        remember(memory)
        add(points, share, step, points)
        gradient, tried_gradient = tried_gradient, gradient
        energy = tried_energy
        iterations += 1


@compiled
@no_type_check
def descend(gradient: Components, stiffness: Envelope, memory: Memory, step: Components) -> None:
    """Write the quasi-Newton step (Nocedal and Wright 2006, algorithm 7.4)."""
    size, free = memory.steps.shape[0], step.shape[1]
    filled, following = memory.cursor[0], memory.cursor[1]
    weight = np.empty(size)
    for d in range(3):
        for i in range(free):
            step[d, i] = -gradient[d, i]
    for age in range(1, filled + 1):
        k = (following - age) % size
        weight[k] = memory.inverse[k] * inner(memory.steps[k], step)
        add(step, -weight[k], memory.changes[k], step)
    solve(stiffness, step)
    for age in range(filled, 0, -1):
        k = (following - age) % size
        correction = weight[k] - memory.inverse[k] * inner(memory.changes[k], step)
        add(step, correction, memory.steps[k], step)


@compiled
@no_type_check
def remember(memory: Memory) -> None:
    """Keep the step at the cursor in the place of the oldest."""
    size = memory.steps.shape[0]
    k = memory.cursor[1]
    step, change = memory.steps[k], memory.changes[k]
    curvature = inner(change, step)
    if curvature > FLAT * np.sqrt(inner(step, step) * inner(change, change)):
        memory.inverse[k] = 1 / curvature
        memory.cursor[0] = min(memory.cursor[0] + 1, size)
        memory.cursor[1] = (k + 1) % size
    else:
        # Where the energy is not convex along a step, it says nothing of a minimum. What was
        # in its place is lost.
        memory.cursor[0] = min(memory.cursor[0], size - 1)


@compiled
@no_type_check
def inner(u: Components, v: Components) -> float:
    """Return the scalar product over the columns of the second."""
    total = 0.0
    for d in range(3):
        for i in range(v.shape[1]):
            total += u[d, i] * v[d, i]
    return total


@compiled
@no_type_check
def add(u: Components, factor: float, v: Components, total: Components) -> None:
    """Write u + factor v over the columns that all of them have."""
    for d in range(3):
        for i in range(min(u.shape[1], v.shape[1], total.shape[1])):
            total[d, i] = u[d, i] + factor * v[d, i]


@compiled
@no_type_check
def farthest(step: Components) -> float:
    """Return the length of the longest column, NaN if a column is."""
    longest = 0.0
    for i in range(step.shape[1]):
        length = step[0, i] ** 2 + step[1, i] ** 2 + step[2, i] ** 2
        if np.isnan(length):
            return length
        longest = max(longest, length)
    return np.sqrt(longest)
