"""Whether object stores and Ray can be spoken to, without any of either being there."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib import import_module
from typing import Any

BYTES = b"an episode" * 100
_NAME = "bucket/episode"


class _Store(BaseHTTPRequestHandler):
    """As much of Amazon's protocol as it takes to put an object down and to get it again."""

    protocol_version = "HTTP/1.1"  # in which a client may ask whether to go on
    objects: dict[str, bytes]

    def do_PUT(self) -> None:
        """Take an object."""
        self.objects[self.path] = self.rfile.read(int(self.headers["Content-Length"]))
        self._answer(b"")

    def do_HEAD(self) -> None:
        """Say how large an object is."""
        self._answer(self.objects[self.path], body=False)

    def do_GET(self) -> None:
        """Give an object."""
        self._answer(self.objects[self.path.partition("?")[0]])

    def _answer(self, content: bytes, *, body: bool = True) -> None:
        self.send_response(200)
        self.send_header("Content-Length", str(len(content)))
        self.send_header("ETag", '"0"')
        self.end_headers()
        if body:
            self.wfile.write(content)

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002
        """Say nothing."""


@contextmanager
def _store_here() -> Iterator[str]:
    """Run a store on this machine; yield its address."""
    handler = type("Store", (_Store,), {"objects": {}})
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        try:
            yield f"http://127.0.0.1:{server.server_port}"
        finally:
            server.shutdown()


def store() -> str:
    """Let s3fs put an object into a store on this machine, and get it again."""
    s3fs: Any = import_module("s3fs")

    with _store_here() as address:
        # Signed as for the real one, by a key that opens nothing.
        files = s3fs.S3FileSystem(
            key="doctor",
            secret="doctor",  # noqa: S106
            endpoint_url=address,
            client_kwargs={"region_name": "us-east-1"},
            config_kwargs={
                "s3": {"addressing_style": "path"},
                "request_checksum_calculation": "when_required",
                "proxies": {},
            },
            skip_instance_cache=True,
        )
        files.pipe_file(_NAME, BYTES)
        if files.cat_file(_NAME) != BYTES:
            raise RuntimeError("an object reads otherwise than it was written")
    return f"s3fs {s3fs.__version__} wrote and read an object"


def pickle_task() -> str:
    """Make a task ready for Ray; starting a cluster would take seconds."""
    ray: Any = import_module("ray")
    cloudpickle: Any = import_module("ray.cloudpickle")

    factor = 6
    task = cloudpickle.loads(cloudpickle.dumps(lambda number: factor * number))
    if task(7) != 42:
        raise RuntimeError("a task of Ray answers otherwise than it should")
    return f"Ray {ray.__version__} packed a task; --thorough starts a cluster"


def run_task() -> str:
    """Start a cluster of one processor and let it do a task."""
    ray: Any = import_module("ray")

    ray.init(num_cpus=1, include_dashboard=False, log_to_driver=False, configure_logging=False)
    try:
        task = ray.remote(lambda number: 6 * number)  # of Python: Ray takes no builtin
        answer = ray.get(task.remote(7), timeout=60)
    finally:
        ray.shutdown()
    if answer != 42:
        raise RuntimeError(f"a cluster answers {answer} for 42")
    return f"Ray {ray.__version__} ran a task on a cluster"
