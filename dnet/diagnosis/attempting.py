"""The process in which abilities are tried: `python -m dnet.diagnosis.attempting NAME=ATTEMPT ...`.

Each attempt is announced before it begins, for a broken library may end the process.
"""

import json
import os
import sys
import warnings
from collections.abc import Mapping
from importlib import import_module
from typing import TextIO


def main() -> None:
    """Try what the arguments name, and write a line of JSON before and after each."""
    # What libraries print is no part of the answer.
    with os.fdopen(os.dup(1), "w", encoding="utf-8") as answers:
        os.dup2(2, 1)
        warnings.simplefilter("ignore")
        for argument in sys.argv[1:]:
            name, _, attempt = argument.partition("=")
            _write(answers, {"name": name, "begun": True})
            _write(answers, {"name": name} | _tried(attempt))


def _tried(attempt: str) -> dict[str, str]:
    module, _, function = attempt.partition(":")
    try:
        whole = module if "." in module else f"{__package__}.{module}"
        note: str = getattr(import_module(whole), function)()
    except Exception as error:  # whatever it is, it does not work
        return {"fails": " ".join(str(error).split()) or type(error).__name__}
    return {"works": note}


def _write(answers: TextIO, line: Mapping[str, object]) -> None:
    answers.write(json.dumps(line) + "\n")
    answers.flush()


if __name__ == "__main__":
    main()
