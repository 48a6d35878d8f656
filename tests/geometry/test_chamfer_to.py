import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from dnet.geometry.chamfer import chamfer
from dnet.geometry.chamfer_to import ChamferTo


@settings(deadline=None, max_examples=40)
@given(counts=st.lists(st.integers(1, 60), min_size=1, max_size=4), seed=st.integers(0, 99))
def test_it_is_the_chamfer_distance_to_one_cloud_after_the_other(
    counts: list[int], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    reference, *clouds = (
        rng.normal(size=(count, 3)).astype(np.float32) for count in [*counts, counts[0]]
    )
    distance = ChamferTo(reference)
    for cloud in clouds:
        assert distance(cloud) == chamfer(cloud, reference)
