"""The process that draws charts: ``python -m uwbbench.show.drawer``, asked by :mod:`uwbbench.show.drawing`.

Each line of input is a request, a list of a function's name and its argument; each answer its length and content.
"""

from __future__ import annotations

import json
import struct
import sys
from typing import Any

LENGTH = struct.Struct("<Q")


def _made(what: str, value: Any) -> bytes:
    import vl_convert

    match what:
        case "script":
            script: str = vl_convert.javascript_bundle()  # type: ignore[call-arg]  # its stub knows no default
            return script.encode()
        case "svg":
            return bytes(vl_convert.vegalite_to_svg(value).encode())
        case "png":
            return bytes(vl_convert.svg_to_png(value, scale=2))
    raise ValueError(what)


def main() -> None:
    """Answer requests until there are no more."""
    for line in sys.stdin:
        answer = _made(*json.loads(line))
        sys.stdout.buffer.write(LENGTH.pack(len(answer)) + answer)
        sys.stdout.buffer.flush()


if __name__ == "__main__":
    main()
