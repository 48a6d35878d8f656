"""Everything that dnet can do where all is installed, and what tries whether it can here."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Ability:
    """Something that works or does not, whatever else does."""

    name: str
    commands: tuple[str, ...]
    """Those that need it."""
    modules: tuple[str, ...]
    """What must be installed for it."""
    attempt: str
    """A function that does it once and says what came out, as in `module:name`,
    the module of this package unless it has a dot."""
    process: str
    """Attempts of one process share what they import, which is most of their time; processes run
    beside each other. Those of `networks` import torch and numba, those of `others` neither."""
    needed: bool = True
    """Whether dnet is broken without; else it only lacks something."""
    thorough: str = ""
    """Another one that takes seconds and does all of it, if there is one."""
    remedy: str = ""
    """What mends it if everything is installed and it fails even so, if that is known."""


_LOGS = ("mcap", "mcap_protobuf", "google.protobuf", "polars", "numpy", "scipy", "lz4", "zstandard")
_NETWORKS = ("torch", "numba", "safetensors", "scipy", "numpy")
_DRAWING = (
    "apt-get install -y --no-install-recommends mesa-vulkan-drivers libegl1 libxkbcommon0 "
    "libxkbcommon-x11-0 libwayland-client0 libxcursor1 libxi6 libxrandr2"
)

ABILITIES = (
    Ability(
        "physics",
        ("record", "servo"),
        ("pybullet",),
        "laboratory_attempts:step",
        "others",
    ),
    Ability(
        "planning",
        ("record", "servo"),
        ("ompl",),
        "laboratory_attempts:plan",
        "others",
    ),
    Ability(
        "logs",
        ("record", "train", "servo", "inspect", "play"),
        _LOGS,
        "laboratory_attempts:log",
        "others",
    ),
    Ability(
        "networks",
        ("train", "servo", "evaluate"),
        _NETWORKS,
        "learning_attempts:predict",
        "networks",
        thorough="learning_attempts:predict_fused",
    ),
    Ability(
        "training",
        ("train",),
        _NETWORKS,
        "learning_attempts:train",
        "networks",
        thorough="learning_attempts:train_by_optimizer",
    ),
    Ability(
        "recordings",
        ("servo", "play"),
        ("rerun",),
        "showing_attempts:write",
        "others",
    ),
    Ability(
        "viewer",
        ("play",),
        ("rerun_cli",),
        "showing_attempts:start_viewer",
        "others",
    ),
    Ability(
        "pictures",
        ("inspect", "evaluate", "play --film"),
        ("matplotlib", "PIL"),
        "showing_attempts:draw",
        "others",
    ),
    Ability(
        "window",
        ("play", "servo --view"),
        (),
        "showing_attempts:find_screen",
        "others",
        needed=False,
        remedy="draw with --screenshot, or write --save OUT.rrd and open it elsewhere",
    ),
    Ability(
        "screenshots",
        ("play --screenshot", "demo"),
        ("rerun", "rerun_cli"),
        "showing_attempts:find_renderer",
        "drawing",
        needed=False,
        thorough="showing_attempts:draw_screenshot",
        remedy=_DRAWING,
    ),
    Ability(
        "GPU",
        ("train",),
        ("torch",),
        "learning_attempts:multiply",
        "networks",
        needed=False,
        remedy="none is needed; for an NVIDIA GPU, its driver and a torch with CUDA",
    ),
    Ability(
        "ONNX",
        ("export", "servo --checkpoint a.onnx"),
        ("onnx", "onnxruntime"),
        "learning_attempts:run_onnx",
        "networks",
        needed=False,
    ),
    Ability(
        "TensorBoard",
        ("train --tensorboard",),
        ("tensorboard",),
        "learning_attempts:write_board",
        "networks",
        needed=False,
    ),
    Ability(
        "report",
        ("evaluate paper", "reproduce"),
        ("jinja2", "plotly"),
        "showing_attempts:write_report",
        "others",
        needed=False,
    ),
    Ability(
        "clouds",
        ("servo --goal a.ply",),
        ("trimesh", "pypcd4"),
        "exchange_attempts:read_clouds",
        "networks",
        needed=False,
    ),
    Ability(
        "HDF5",
        ("inspect export",),
        ("h5py",),
        "exchange_attempts:write_hdf5",
        "others",
        needed=False,
    ),
    Ability(
        "registration",
        ("evaluate keypoints --drift",),
        ("pycpd",),
        "exchange_attempts:register",
        "networks",
        needed=False,
    ),
    Ability(
        "object stores",
        ("record s3://", "train s3://"),
        ("s3fs",),
        "cluster_attempts:store",
        "others",
        needed=False,
    ),
    Ability(
        "Ray",
        ("record --ray",),
        ("ray",),
        "cluster_attempts:pickle_task",
        "others",
        needed=False,
        thorough="cluster_attempts:run_task",
    ),
)
"""In the order in which they are told."""
