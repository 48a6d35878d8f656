"""The simulated material is the one that was asked for, and what says so is right."""

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from PIL import Image

from dnet.errors import BrokenLimit, TooFew
from dnet.sim.tetrahedra import box_mesh
from dnet.sim.tissue import tissue_mesh
from dnet.tools.material import Validation, validate
from dnet.tools.material_agreement import Agreement, compare
from dnet.tools.material_bending import KNOWN_RATIOS, cantilever, timoshenko
from dnet.tools.material_checks import Check, check_table, checks, mesh_table, refuse_broken
from dnet.tools.material_document import write_tables
from dnet.tools.material_meshes import Resolution, choose, compare_meshes, sampler
from dnet.tools.material_plot import draw_material
from dnet.tools.material_tension import STRAIN, pull, uniaxial
from dnet.types import Tissue


@pytest.fixture(scope="module")
def validation() -> Validation:
    """What the command measures, of few shapes and coarse meshes."""
    tissue = Tissue()
    return Validation(
        tissue=tissue,
        tension=pull(young=tissue.young, poisson=tissue.poisson),
        bendings=[
            cantilever(cells, young=tissue.young, poisson=tissue.poisson) for cells in (1, 2, 3)
        ],
        agreement=compare(tissue, 2, seed=5),
        resolutions=compare_meshes(
            tissue, 2, candidates=((4, 4, 2), tissue.cells), finest=(12, 12, 5), seed=0
        ),
        seconds={},
    )


@pytest.mark.parametrize(("young", "poisson"), [(1000.0, 0.3), (5000.0, 0.4), (300.0, 0.1)])
def test_a_bar_is_as_stiff_as_the_energy_says(young: float, poisson: float) -> None:
    tension = pull(young=young, poisson=poisson)
    assert tension.strain.min() < STRAIN < tension.strain.max()
    stress, contraction = uniaxial(tension.strain, young=young, poisson=poisson)
    np.testing.assert_allclose(tension.stress, stress, rtol=0.01)
    np.testing.assert_allclose(tension.contraction, contraction, rtol=0.05)
    assert tension.initial_young == pytest.approx(young, rel=0.01)


def test_a_bar_recovers_young_and_poisson_at_three_percent(validation: Validation) -> None:
    assert validation.tension.young == pytest.approx(validation.tissue.young, rel=0.02)
    assert validation.tension.poisson == pytest.approx(validation.tissue.poisson, rel=0.05)


def test_the_energy_is_linear_elasticity_at_small_strain() -> None:
    stress, contraction = uniaxial(np.array([1e-5]), young=2000.0, poisson=0.25)
    assert stress[0] == pytest.approx(2000.0 * 1e-5, rel=1e-4)
    assert contraction[0] == pytest.approx(0.25 * 1e-5, rel=1e-4)


def test_cantilevers_of_more_cells_bend_more(validation: Validation) -> None:
    ratios = [bending.ratio for bending in validation.bendings]
    assert ratios == sorted(ratios)
    known = [KNOWN_RATIOS[bending.cells] for bending in validation.bendings]
    np.testing.assert_allclose(ratios, known, atol=0.02)


def test_a_slender_beam_bends_as_eulers() -> None:
    """F L^3 / (3 E I) under a force at its end, w L^4 / (8 E I) under a uniform load."""
    beam = {"young": 1000.0, "poisson": 0.3, "width": 0.01, "thickness": 0.01}
    inertia, length = 0.01**4 / 12, 2.0
    at_end = timoshenko(np.array([1e-9]), np.array([length]), **beam)
    assert at_end == pytest.approx(1e-9 * length**3 / (3 * 1000 * inertia), rel=1e-4)
    places = np.linspace(0, length, 2001)
    load = np.full(2001, 1e-9)
    load[[0, -1]] /= 2
    uniform = load.sum() / length
    assert timoshenko(load, places, **beam) == pytest.approx(
        uniform * length**4 / (8 * 1000 * inertia), rel=1e-4
    )


def test_a_stub_shears_as_cowper_says() -> None:
    """k = 13/15.3 for a rectangle of nu = 0.3 (Cowper 1966): almost all deflection is shear."""
    beam = {"young": 1000.0, "poisson": 0.3, "width": 1.0, "thickness": 1.0}
    deflection = timoshenko(np.array([1.0]), np.array([0.01]), **beam)
    assert deflection == pytest.approx(0.01 / (13 / 15.3 * 1000 / 2.6), rel=1e-3)


def test_pybullet_settles_where_the_independent_solver_does(validation: Validation) -> None:
    agreement = validation.agreement
    assert agreement.from_rest.shape == (2, len(tissue_mesh(validation.tissue).nodes))
    assert agreement.motion_mm.min() > 5
    assert agreement.from_rest.mean() < 0.15
    assert not agreement.bistable.any()


def test_another_material_would_be_told_apart(validation: Validation) -> None:
    other = compare(Tissue(), 1, seed=5, reference=replace(Tissue(), poisson=0.1))
    assert other.from_rest[0].mean() > 5 * validation.agreement.from_rest[0].mean()


def test_shapes_apart_are_bistable_only_if_both_are_at_rest() -> None:
    far, near = np.full(4, 9.0), np.full(4, 0.1)
    agreement = Agreement(
        motion_mm=np.ones(3),
        from_rest=np.array([near, far, far]),
        from_shape=np.array([near, near, far]),
        rejected=Counter(),
    )
    assert agreement.bistable.tolist() == [False, True, False]


def test_finer_meshes_are_nearer_to_the_finest(validation: Validation) -> None:
    coarse, fine = validation.resolutions
    assert fine.pull_mm < coarse.pull_mm
    assert fine.face_mm < coarse.face_mm
    assert coarse.nodes == 5 * 5 * 3


def test_the_finest_mesh_is_no_distance_from_itself() -> None:
    (itself,) = compare_meshes(Tissue(), 1, candidates=((4, 4, 2),), finest=(4, 4, 2), seed=0)
    assert itself.pull_mm == itself.face_mm == 0


def test_points_go_where_the_mesh_around_them_goes() -> None:
    mesh = box_mesh((0.1, 0.06, 0.04), (3, 2, 2))
    points = np.random.default_rng(0).uniform(-0.5, 0.5, (200, 3)) * (0.1, 0.06, 0.04)
    where = sampler(mesh, points)
    np.testing.assert_allclose(where(mesh.nodes), points, atol=1e-12)
    stretch, shift = np.array([[1.2, 0.1, 0.0], [0.0, 0.9, 0.3], [0.2, 0.0, 1.1]]), 0.05
    carried = where(mesh.nodes @ stretch + shift)
    np.testing.assert_allclose(carried, points @ stretch + shift, atol=1e-12)


def test_the_mesh_chosen_is_the_nearest_that_bends_and_is_affordable() -> None:
    def mesh(cells: tuple[int, int, int], nodes: int, pull_mm: float) -> Resolution:
        return Resolution(cells, nodes, pull_mm, pull_mm, pull_mm, 1.0, 1.0)

    thin, large = mesh((9, 9, 3), 400, 0.1), mesh((16, 16, 6), 2023, 0.1)
    near, far = mesh((8, 8, 4), 405, 0.2), mesh((7, 7, 4), 320, 0.3)
    assert choose([thin, far, near, large]) == near


def test_every_figure_has_a_verdict(validation: Validation) -> None:
    found = checks(validation)
    table = check_table(found)
    assert table.height == 4 + 3 + 4 + 1
    assert set(table["verdict"]) == {"holds"}
    refuse_broken(found)
    assert mesh_table(validation.resolutions)["cells"].to_list() == [
        "4 x 4 x 2",
        " x ".join(map(str, validation.tissue.cells)),
    ]


def test_a_material_off_its_limits_is_refused(validation: Validation) -> None:
    softer = replace(validation, tissue=replace(validation.tissue, young=1100.0))
    found = checks(softer)
    assert "BROKEN" in check_table(found)["verdict"].to_list()
    with pytest.raises(BrokenLimit, match=r"modulus at 3% strain is 982 Pa, limit 1100 Pa"):
        refuse_broken(found)


def test_disagreement_that_is_not_bistable_breaks_a_limit(validation: Validation) -> None:
    apart = replace(
        validation.agreement,
        from_rest=validation.agreement.from_rest + 9.0,
        from_shape=validation.agreement.from_shape + 9.0,
    )
    verdicts = {c.name: c.holds for c in checks(replace(validation, agreement=apart))}
    assert not verdicts["worst node error of these shapes"]
    assert verdicts["shapes with more than one equilibrium"]


def test_pulls_that_never_came_to_rest_break_a_limit(validation: Validation) -> None:
    swinging = replace(validation.agreement, rejected=Counter(unsettled=1))
    broken = [c for c in checks(replace(validation, agreement=swinging)) if not c.holds]
    assert [(c.name, c.measured) for c in broken] == [("pulls that never came to rest", "1 of 3")]


def test_no_shapes_are_refused() -> None:
    with pytest.raises(TooFew, match="number of shapes is 0"):
        validate(0)


def test_the_picture_is_a_png_of_four_panels(validation: Validation, tmp_path: Path) -> None:
    path = tmp_path / "pictures" / "material.png"
    draw_material(validation, path)
    with Image.open(path) as picture:
        assert picture.format == "PNG"
        assert picture.size == (1320, 935)
        assert len(picture.convert("RGB").getcolors(1 << 24) or []) > 50


def test_tables_are_replaced_and_prose_stays(tmp_path: Path) -> None:
    path = tmp_path / "material.md"
    path.write_text("# Before\n")
    table = pl.DataFrame({"figure": ["E"], "Pa": [1.0]})
    write_tables(path, [table])
    path.write_text(path.read_text() + "After\n")
    write_tables(path, [table.with_columns(Pa=pl.lit(2.0))])
    text = path.read_text()
    assert text.startswith("# Before\n")
    assert text.endswith("After\n")
    assert "| figure | Pa |\n| --- | ---: |\n| E | 2.00 |" in text
    assert "1.00" not in text


def test_a_check_that_holds_is_not_refused() -> None:
    refuse_broken([Check("a", "1", "2", holds=True)])
