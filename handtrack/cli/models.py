"""Which hand model the command line fits."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from handtrack.cli.options import is_default
from handtrack.errors import InputError, SettingsError

if TYPE_CHECKING:
    from collections.abc import Callable

    from handtrack import MANO, HandModel, Sequence, Track
    from handtrack.hand.model import Array
    from handtrack.hand.skeleton import Hand

_Command = TypeVar("_Command", bound="Callable[..., Any]")


def model_options(command: _Command) -> _Command:
    """Give a command the options that say which hand to fit, taken by `take_models`."""
    gltf = click.option(
        "--gltf",
        type=click.Path(path_type=Path),
        metavar="PATH",
        help="Fit a skinned hand: .glb on WebXR's joints, or a folder with left and right.",
    )
    return mano_options(gltf(command))


hand_model_option = click.option(
    "--hand-model",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="The subject's hand, from `handtrack calibrate`; fitted as it is.",
)


def mano_options(command: _Command) -> _Command:
    """Give a command the options that name the user's MANO."""
    for option in (
        click.option(
            "--mano-tips",
            type=click.Choice(["smplx", "manopth", "freihand", "minimal-hand"]),
            default="smplx",
            show_default=True,
            help="Whose vertices of MANO are the fingertips.",
        ),
        click.option(
            "--mano",
            type=click.Path(path_type=Path),
            metavar="DIR",
            help="Your MANO: a file, or a folder with MANO_RIGHT.pkl and MANO_LEFT.pkl.",
        ),
    ):
        command = option(command)
    return command


def take_models(options: dict[str, Any], limits: str) -> Models:
    """Take the values of `model_options` out of a command's options.

    Raises:
        SettingsError: two hands, tips of no hand, or a file that is not there.
    """
    if options["mano"] is None and not is_default("mano_tips"):
        raise SettingsError("--mano-tips are of --mano: give both")
    for name in ("hand_model", "mano", "gltf"):
        path = options.get(name)
        if path is not None and not path.exists():
            raise InputError("no such file or folder", path)
    names = ("mano", "mano_tips", "gltf")
    return Models(limits, options.pop("hand_model", None), **{n: options.pop(n) for n in names})


class Models:
    """The hand to fit, left or right, by the values of `model_options`."""

    def __init__(
        self,
        limits: str,
        file: Path | None = None,
        *,
        mano: Path | None,
        mano_tips: str,
        gltf: Path | None,
    ) -> None:
        if mano is not None and gltf is not None:
            raise SettingsError("--mano and --gltf name two hands, expected one")
        self.file, self.limits = file, limits
        self._limits, self._mano, self._tips, self._gltf = limits, mano, mano_tips, gltf
        self._made: dict[Hand, HandModel] = {}
        self._manos: dict[Hand, MANO] = {}

    @property
    def base(self) -> tuple[str, str]:
        """Which hand it is, as `save_hand` wants it, and its file."""
        if self._mano is not None:
            return "mano", str(self._mano.absolute())
        return ("default", "") if self._gltf is None else ("gltf", str(self._gltf.absolute()))

    def told(self) -> dict[str, object]:
        """What makes it another hand than others: the options, and what is in their files."""
        from handtrack.batching.source import content_digest

        files = {"file": self.file, "mano": self._mano, "gltf": self._gltf}
        read = {name: path and content_digest([path]) for name, path in files.items()}
        return {"limits": self._limits, "tips": self._tips, **read}

    def __getstate__(self) -> dict[str, Any]:
        # a hand is read where it is needed
        return {**self.__dict__, "_made": {}, "_manos": {}}

    def mano(self, hand: Hand) -> MANO | None:
        """The user's MANO of a hand, if it is to be fitted."""
        return None if self._mano is None else self._mano_of(hand)

    def keep(self, model: HandModel) -> None:
        """Have this model for its hand."""
        self._made[model.hand] = model

    def of(self, hand: Hand, shape: Array | None = None) -> HandModel:
        """The model of a hand, read once.

        Args:
            hand: which.
            shape: (S,) of MANO; the mean hand by default.

        Raises:
            HandtrackError: a file that it needs is not there or cannot be used.
        """
        from handtrack import HandModel

        if self._mano is not None and shape is not None and len(shape):
            return self._mano_of(hand).model(shape, self._limits)
        if hand not in self._made and self.file is not None:
            self._made[hand] = self._from_file(self.file, hand)
        if hand not in self._made:
            if self._mano is not None:
                self._made[hand] = self._mano_of(hand).model(limits=self._limits)
            elif self._gltf is not None:
                self._made[hand] = HandModel.from_gltf(self._gltf, hand, limits=self._limits)
            else:
                self._made[hand] = HandModel.default(hand, self._limits)
        return self._made[hand]

    def subject(self, sequence: Sequence, calibrate: Any) -> tuple[HandModel, Any]:
        """The model for a sequence, and how `handtrack.track` is to calibrate it.

        A MANO that is to be calibrated takes the subject's shape in its own shape space and is
        then left as it is, so that poses and betas are MANO's.

        Raises:
            HandtrackError: a file cannot be used, or the sequence shows too little.
        """
        if self._mano is None or calibrate not in (True, "auto"):
            return self.of(sequence.hand), calibrate
        from handtrack.fitting.mano_shape import mano_shape

        return mano_shape(self._mano_of(sequence.hand), sequence, self._limits).model, "none"

    def _mano_of(self, hand: Hand) -> MANO:
        from handtrack import MANO

        if self._mano is not None and hand not in self._manos:
            self._manos[hand] = MANO.load(self._mano, hand, tips=self._tips)
        return self._manos[hand]

    def _from_file(self, path: Path, hand: Hand) -> HandModel:
        from handtrack.hand.hand_file import load_hand, read_hand

        stored = read_hand(path)
        if stored.hand != hand:
            raise InputError(f"is a {stored.hand} hand, the sequence is of the {hand} one", path)
        base = None
        if self._mano is not None or self._gltf is not None:
            plain = Models(self._limits, mano=self._mano, mano_tips=self._tips, gltf=self._gltf)
            base = plain.of(hand, stored.shape)
        return load_hand(path, base).with_limits(self._limits)

    def dressed(self, track: Track) -> Track:
        """A track from a recording with the skin of the model that is named, if one is.

        Raises:
            HandtrackError: a file cannot be used, or it is not the hand that was recorded.
        """
        from handtrack.exporting.dress import dressed

        if self._mano is None and self._gltf is None:
            return track
        return dressed(track, self.of(track.hand, track.model.shape))
