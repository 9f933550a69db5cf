"""On which sockets a process listens, as Linux says."""

from __future__ import annotations

import os
from pathlib import Path


def listening(pid: int) -> list[tuple[str, int]]:
    """(address, port) of the TCP sockets on which a process listens."""
    inodes = set()
    for link in Path(f"/proc/{pid}/fd").iterdir():
        target = os.readlink(link) if link.is_symlink() else ""
        if target.startswith("socket:["):
            inodes.add(target[8:-1])
    out = []
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/{pid}/net/{table}").read_text().splitlines()[1:]:
            fields = line.split()
            if fields[3] == "0A" and fields[9] in inodes:
                address, port = fields[1].split(":")
                ip = ".".join(str(b) for b in reversed(bytes.fromhex(address)))
                out.append((ip, int(port, 16)))
    return out
