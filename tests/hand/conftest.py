"""Free stand-ins for MANO's files, stored as MANO's are."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import pytest

from tools.make import mano_like


@pytest.fixture(scope="session")
def maker() -> ModuleType:
    """The tool that makes them."""
    return mano_like


@pytest.fixture(scope="session")
def contents(maker: ModuleType) -> dict[str, dict]:
    """Their arrays, by hand."""
    return {hand: maker.make_mano_like(hand) for hand in ("right", "left")}


@pytest.fixture(scope="session")
def mano_folder(maker: ModuleType, contents, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with MANO_RIGHT.pkl and MANO_LEFT.pkl."""
    folder = tmp_path_factory.mktemp("mano")
    for hand, content in contents.items():
        with (folder / f"MANO_{hand.upper()}.pkl").open("wb") as file:
            maker.write_pickle(content, file)
    return folder
