"""What the project is made, measured and documented with; none of it is installed."""

import sys
from types import TracebackType


def _told(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    """Ctrl-C and files that cannot be written are one line, not a trace."""
    if issubclass(kind, KeyboardInterrupt):
        print("stopped", file=sys.stderr)
    elif issubclass(kind, OSError):
        print(f"error: {error}", file=sys.stderr)
    else:
        sys.__excepthook__(kind, error, trace)


# python -m tools.X is about to run; not where tests import the tools
if sys.argv[:1] == ["-m"]:
    sys.excepthook = _told
