"""What no line of the product may call, and what those that may be called must be told."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from dnet.recorders import viewer_process

ROOT = Path(__file__).resolve().parent.parent
FOLDERS = ("dnet", "recorders", "datasets", "tools", "examples")
FILES = sorted({path.resolve() for folder in FOLDERS for path in (ROOT / folder).rglob("*.py")})
"""Each once: three of the folders are linked into another."""

NEVER_IMPORTED = {
    *("pickle", "cPickle", "_pickle", "dill", "cloudpickle", "joblib", "shelve", "marshal"),
    *("yaml", "tarfile", "urllib.request", "requests", "httpx", "aiohttp", "ftplib", "telnetlib"),
    *("socketserver", "xmlrpc", "torch.hub", "torch.package", "pandas"),
    *("xml.dom", "xml.sax", "lxml", "code", "pty", "imp"),
}
NEVER_CALLED = {
    *("eval", "exec", "compile", "__import__", "input"),
    *("torch.load", "torch.save", "torch.jit.load", "torch.package", "torch.hub.load"),
    *("os.system", "os.popen", "os.execv", "os.execvp", "os.spawnv"),
    *("subprocess.getoutput", "subprocess.getstatusoutput"),
    *("tempfile.mktemp", "shutil.unpack_archive", "pathlib.os.system"),
    *("np.genfromtxt", "np.fromfile", "numpy.genfromtxt", "numpy.fromfile"),
}
XML_READERS = {"parse", "iterparse", "fromstring", "fromstringlist", "XML", "XMLParser", "XMLID"}
UNPACKERS = {"extract", "extractall"}


def dotted(node: ast.expr) -> str:
    """Return a name such as `np.load`, empty for what is none."""
    if isinstance(node, ast.Name):
        return node.id
    if isinstance(node, ast.Attribute):
        before = dotted(node.value)
        return f"{before}.{node.attr}"
    return ""


def is_constant(call: ast.Call, name: str, value: object) -> bool:
    return any(
        one.arg == name and isinstance(one.value, ast.Constant) and one.value.value is value
        for one in call.keywords
    )


def full_names(tree: ast.AST) -> dict[str, str]:
    """Return what each imported name stands for."""
    names = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for one in node.names:
                names[one.asname or one.name.partition(".")[0]] = (
                    one.name if one.asname else one.name.partition(".")[0]
                )
        elif isinstance(node, ast.ImportFrom):
            for one in node.names:
                names[one.asname or one.name] = f"{node.module}.{one.name}"
    return names


def imported(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (one.name for one in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield from (f"{node.module}.{one.name}" for one in node.names)
        elif isinstance(node, ast.Call) and dotted(node.func).endswith("import_module"):
            yield from (str(one.value) for one in node.args if isinstance(one, ast.Constant))


def faults(source: str) -> list[str]:
    """Return what is wrong with a module, a line each."""
    tree = ast.parse(source)
    names = full_names(tree)
    found = [
        f"imports {name}"
        for name in imported(tree)
        if any(name == bad or name.startswith(f"{bad}.") for bad in NEVER_IMPORTED)
    ]
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            short = dotted(node.func)
            first, _, rest = short.partition(".")
            full = names.get(first, first) + (f".{rest}" if rest else "")
            found += [f"line {node.lineno}: {why}" for why in call_faults(node, short, full)]
    return found


def call_faults(call: ast.Call, short: str, full: str) -> Iterator[str]:
    last = short.rpartition(".")[2]
    if short in NEVER_CALLED or full in NEVER_CALLED:
        yield f"calls {short}"
    if any(one.arg == "shell" and not is_constant(call, "shell", False) for one in call.keywords):
        yield f"{short} has a shell"
    if any(
        one.arg == "allow_pickle" and not is_constant(call, "allow_pickle", False)
        for one in call.keywords
    ):
        yield f"{short} may unpickle"
    if full in ("numpy.load", "numpy.save") and not is_constant(call, "allow_pickle", False):
        yield f"{short} does not say allow_pickle=False"
    if last in UNPACKERS and not full.startswith("polars"):
        yield f"{short} unpacks to names of an archive"
    if full.startswith("xml.etree") and last in XML_READERS:
        yield f"{short} reads XML without defence"
    if full.startswith("subprocess.") and call.args and not _is_list(call.args[0]):
        yield f"{short} is given a text"


def _is_list(node: ast.expr) -> bool:
    """Return whether a command may be a list: it is no text, and made of none."""
    return not isinstance(node, ast.JoinedStr | ast.Constant | ast.BinOp)


def test_there_is_much_to_look_at() -> None:
    assert len(FILES) > 250
    assert {path.relative_to(ROOT).parts[0] for path in FILES} == set(FOLDERS)


def test_nothing_in_the_product_runs_what_a_file_says() -> None:
    found = [
        f"{path.relative_to(ROOT)} {fault}"
        for path in FILES
        for fault in faults(path.read_text(encoding="utf-8"))
    ]
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    "line",
    [
        "import pickle",
        "from pickle import loads",
        "import torch.hub",
        "from torch import hub",
        "import yaml as y",
        "from urllib.request import urlopen",
        "import importlib; importlib.import_module('pickle')",
        "eval('1')",
        "exec('1')",
        "import torch; torch.load('a', weights_only=True)",
        "from torch import load; load('a')",
        "import numpy as np; np.load('a')",
        "import numpy as np; np.load('a', allow_pickle=True)",
        "from numpy import load as read; read('a', allow_pickle=flag)",
        "import subprocess; subprocess.run(['a'], shell=True)",
        "import subprocess; subprocess.run('a b')",
        "from subprocess import Popen; Popen(f'a {b}')",
        "import os; os.system('a')",
        "from tempfile import mktemp; mktemp()",
        "import zipfile; zipfile.ZipFile('a').extractall()",
        "from xml.etree import ElementTree; ElementTree.parse('a')",
        "from xml.etree.ElementTree import fromstring; fromstring('a')",
    ],
)
def test_what_must_not_be_is_found(line: str) -> None:
    assert faults(line), line


@pytest.mark.parametrize(
    "line",
    [
        "import numpy as np; np.load('a', allow_pickle=False)",
        "import subprocess; subprocess.run(['a', b], check=False)",
        "from xml.etree import ElementTree; ElementTree.SubElement(a, 'b')",
        "model.eval()",
        "import re; re.compile('a')",
    ],
)
def test_what_may_be_is_not(line: str) -> None:
    assert not faults(line), line


STARTERS = (
    "ThreadingHTTPServer",
    "bind",
    "listen",
    "serve_grpc",
    "serve_web",
    "serve_web_viewer",
    "serve_forever",
)
EVERYWHERE = ("0.0.0.0", "::", "--web-viewer")  # noqa: S104  # what is looked for


def servers(source: str) -> list[str]:
    """Return where a module listens, a line each."""
    return [
        ast.unparse(node)
        for node in ast.walk(ast.parse(source))
        if (isinstance(node, ast.Call) and dotted(node.func).rpartition(".")[2] in STARTERS)
        or (isinstance(node, ast.Constant) and node.value in EVERYWHERE)
    ]


def test_nothing_listens_but_to_this_machine() -> None:
    """A socket finds a free port, one is the store of `dnet doctor`; viewers are told `--bind`."""
    found = [line for path in FILES for line in servers(path.read_text(encoding="utf-8"))]
    store = "ThreadingHTTPServer(('127.0.0.1', 0), handler)"
    assert sorted(found) == [store, "probe.bind((LOCAL, 0))"]
    assert viewer_process.LOCAL == "127.0.0.1"
    command = viewer_process.command("a.rrd")
    assert command[command.index("--bind") + 1] == "127.0.0.1"


def test_every_viewer_is_started_by_the_one_command_that_says_where_it_listens() -> None:
    starts = {
        path.name: ast.unparse(node)
        for path in FILES
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call) and dotted(node.func) == "subprocess.Popen"
    }
    own_module = starts.pop("attempts.py")  # of `dnet doctor`, which may crash
    assert own_module.startswith("subprocess.Popen(command,")
    assert list(starts) == ["viewer_process.py"]
