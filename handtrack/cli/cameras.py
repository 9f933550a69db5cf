"""What `track` fits to the pictures of cameras: videos, and landmarks that are stored in files."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from handtrack.cli.inputs import Reading
from handtrack.cli.models import Models
from handtrack.cli.one_camera import Known, say_what_it_knows
from handtrack.cli.sources import Item
from handtrack.errors import InputError, SettingsError

if TYPE_CHECKING:
    from handtrack import Camera
    from handtrack.sequences.hands import HandChoice
    from handtrack.sequences.picture_landmarks import PictureLandmarks
    from handtrack.tracking.settings import TrackSettings
    from handtrack.video.following import Followed
    from handtrack.video.landmark_files import Found
    from handtrack.video.one_camera import SeenHand
    from handtrack.video.views import Views


@dataclass(frozen=True)
class Lens:
    """What the user says of the cameras.

    Attributes:
        file: their calibration.
        size: (width, height) of the pictures [px].
        fov_deg: how wide the camera sees.
        board_unit: unit of the calibration's translations.
    """

    file: Path | None
    size: tuple[int, int] | None
    fov_deg: float | None
    board_unit: str | None = None

    @property
    def known(self) -> str:
        """What is known of the focal length of one camera: "" where it is calibrated."""
        if self.file is not None:
            return ""
        return "assumed" if self.fov_deg is None else f"{self.fov_deg:g} degrees"

    @property
    def given(self) -> bool:
        """Whether anything is said."""
        return any(said is not None for said in vars(self).values())

    def is_of(self, inputs: tuple[Path, ...], reading: Reading) -> bool:
        """Whether it is of one camera that saw joints and their pictures: inputs as they are
        read without a lens.

        Raises:
            InputError: the calibration or an input cannot be read.
            SettingsError: options that do not go together.
        """
        import handtrack as ht
        from handtrack.cli.sources import have_pictures

        if self.file is not None and len(ht.load_cameras(self.file, self.board_unit)) > 1:
            return False
        if not have_pictures(inputs, reading):
            return False
        self.cameras(None, 1 if self.file is None else len(inputs))
        return True

    def cameras(self, unit: str | None, count: int) -> list[Camera] | None:
        """The calibrated cameras, of pictures of the size that is said; None without a file.

        Raises:
            InputError: not as many as inputs, or of another size.
            SettingsError: a calibration and a field of view.
        """
        import handtrack as ht

        if self.file is None:
            if self.board_unit is not None:
                raise SettingsError("--board-unit is the calibration's: give --camera as well")
            if count != 1:
                raise SettingsError(
                    f"--image-size and --fov tell of one camera, {count} inputs are named: name"
                    " one, or give the cameras' --camera calibration"
                )
            return None
        if self.fov_deg is not None:
            raise SettingsError("--camera has the lens already: leave --fov out")
        cameras = ht.load_cameras(self.file, self.board_unit or unit)
        if len(cameras) != count:
            names = ", ".join(c.name for c in cameras)
            raise InputError(
                f"{len(cameras)} cameras ({names}) for {count} inputs: give them in the order of"
                " the calibration",
                self.file,
            )
        for camera in cameras:
            if None not in (self.size, camera.size) and camera.size != self.size:
                raise InputError(
                    f"camera {camera.name} was calibrated for pictures of {camera.size},"
                    f" --image-size says {self.size}",
                    self.file,
                )
        return [replace(c, size=c.size or self.size) for c in cameras]

    def camera(self, size: tuple[int, int], source: str = "") -> Camera:
        """The one camera of pictures of a size; without a file no more is known of it than how wide
        it sees, if that.

        Raises:
            InputError: the calibration is of pictures of another size.
        """
        calibrated = self.cameras(None, 1)
        if calibrated is not None:
            from handtrack.video.views import check_size

            check_size(calibrated[0], size, source)
            return calibrated[0]
        from handtrack.video.landmark_files import camera_of_view
        from handtrack.video.placing import assumed_camera

        return assumed_camera(size) if self.fov_deg is None else camera_of_view(size, self.fov_deg)


def from_cameras(
    lens: Lens,
    inputs: tuple[Path, ...],
    reading: Reading,
    models: Models,
    settings: TrackSettings,
    quiet: bool,
) -> tuple[Item, float]:
    """Hands followed in the pictures of cameras.

    Returns:
        The hands' joints in the cameras' world with the pictures, and how far they are from
        those; and the joints' noise [mm] that the reprojection errors show.

    Raises:
        InputError: the files do not belong together.
    """
    from handtrack.files.pictures import pictures_in
    from handtrack.hand.reshape import without_landmarks
    from handtrack.video.following import follow
    from handtrack.video.pictured import about, noise_told
    from handtrack.video.placing import Seen
    from handtrack.video.views import views_of

    stack = _stack(inputs, reading)
    cameras = lens.cameras(reading.unit, len(stack or inputs))
    if stack is None:
        people, stored = _people(lens, cameras, inputs, reading, quiet)
    else:
        people, stored = _people_of(stack, cameras or [], reading), True
    sequences, noise, hands = [], [], []
    for found in people:
        seen = [f.detections for f in found]
        used = cameras or [lens.camera(seen[0].size)]
        for views in views_of(seen, used):
            swap = not stored and reading.hand == "swap"
            if not (stored or swap or reading.hand in ("auto", views.hand)):
                continue
            views = _told(views, found, "auto" if swap else reading.choice)
            if swap:
                views = _of_other_hand(views)
            if len(used) > 1:
                _check_size(views, lens)
            hand = _hand(views, models, settings, stored)
            followed = follow(views, hand.model, hand.shown, settings)
            # what follows are joint centres
            models.keep(without_landmarks(hand.fitted))
            hands.append(views)
            noise.append(noise_told(followed, hand))
            said = about(followed, hand, len(used), lens.known)
            if stored:
                said["from"] = "landmarks in pictures"
            sequences.append(replace(followed.sequence, cameras=said))
            if not quiet:
                _say(followed, views, said["reprojection_px"]["median"])
                if len(used) == 1:
                    own = models.file is not None
                    say_what_it_knows(Known.of(followed, hand), own, lens.known)
    if not sequences:
        raise InputError(f"there is no {reading.hand} hand", inputs[0])
    pictures = None
    if pictures_in(inputs[0]) is not None:
        pictures = Seen.together([f.detections for f in people[0]], hands)
    return Item.of(sequences, inputs[0], pictures), max(noise)


def _stack(inputs: tuple[Path, ...], reading: Reading) -> list[PictureLandmarks] | None:
    """What several cameras saw, where one file holds it all."""
    from handtrack.sequences.picture_stacks import stack_in

    if len(inputs) != 1:
        return None
    return stack_in(inputs[0], reading.key, reading.order, reading.fps, reading.frame_range)


def _people_of(
    stack: list[PictureLandmarks], cameras: list[Camera], reading: Reading
) -> list[list[Found]]:
    """The one person whom several cameras saw, as `_people` gives people."""
    from handtrack.video.landmark_files import found_in

    sizes = [camera.size or one.extent for camera, one in zip(cameras, stack, strict=True)]
    seen = [found_in([one], size, reading.choice) for one, size in zip(stack, sizes, strict=True)]
    if not all(seen):
        raise InputError(f"there is no {reading.hand} hand", stack[0].source)
    return [[people[0] for people in seen]]


def _told(views: Views, found: list[Found], choice: HandChoice) -> Views:
    """Views with what the user should know; of several cameras the joints' bending tells the hand
    that no file names."""
    from handtrack.sequences.hands import label_hands

    notes = tuple(dict.fromkeys(n for f in found for n in f.notes))
    if len(views.cameras) == 1 or any(f.named for f in found):
        return replace(views, notes=(*views.notes, *notes))
    (points,) = label_hands([views.sequence()], [None], [False], choice, False)
    notes = tuple(n for n in notes if not n.startswith("hand not named"))
    return replace(views, hand=points.hand, notes=(*points.notes, *notes))


def _of_other_hand(views: Views) -> Views:
    """Views of a hand that was found in pictures, called by the other's name."""
    from handtrack.sequences.hands import OTHER

    other, plain = OTHER[views.hand], views.name.removesuffix(f" {views.hand}")
    name = views.name if plain == views.name else f"{plain} {other}"
    return replace(views, hand=other, name=name)


def _people(
    lens: Lens,
    cameras: list[Camera] | None,
    inputs: tuple[Path, ...],
    reading: Reading,
    quiet: bool,
) -> tuple[list[list[Found]], bool]:
    """For each person what each camera saw, and whether that was stored in files.

    Raises:
        InputError: of several cameras one saw several people.
    """
    from handtrack.files.pictures import pictures_in
    from handtrack.video.detections import saved_detections
    from handtrack.video.landmark_files import Found, found_in

    seen: list[list[Found]] = []
    stored = False
    for i, path in enumerate(inputs):
        if path.exists() and pictures_in(path) is not None:
            if lens.size is not None:
                raise SettingsError(f"{path}: pictures have a size: leave --image-size out")
            seen.append([Found(reading._replace(unit=None).detect(path, quiet), ())])
            continue
        saved = saved_detections(path, reading.frame_range)
        if saved is not None:
            seen.append([Found(saved, ())])
            continue
        stored = True
        size = lens.size if cameras is None else cameras[i].size
        people = found_in(reading.landmarks(path), size, reading.choice)
        if not people:
            raise InputError(f"there is no {reading.hand} hand", path)
        if len(people) > 1 and len(inputs) > 1:
            raise InputError(
                f"{len(people)} people in it: which one is which in the other cameras' pictures is"
                " not known (leave one)",
                path,
            )
        seen.append(people)
    return [[people[k] for people in seen] for k in range(len(seen[0]))], stored


def _check_size(views: Views, lens: Lens) -> None:
    """Where cameras are in another unit than said, so is the hand that they see.

    Raises:
        InputError: no hand has that size.
    """
    from handtrack.sequences.size import USUAL_PALM, absurd, is_absurd, palm_length

    palm = palm_length(views.points)
    if is_absurd(palm):
        adult = sum(USUAL_PALM) / 2
        unit = (
            f"{palm / adult:.2g} times shorter"
            if palm > adult
            else f"{adult / palm:.2g} times longer"
        )
        said = "" if lens.board_unit is None else f" with --board-unit {lens.board_unit}"
        advice = (
            ": --board-unit says the unit of the cameras' translations, m, cm, mm or the length of"
            f" a board's square as in 42mm; one about {unit} would fit"
        )
        raise InputError(absurd(palm, said, advice), lens.file)


def _hand(views: Views, models: Models, settings: TrackSettings, stored: bool) -> SeenHand:
    """The hand that is fitted: calibrated where the cameras see how large it is."""
    from handtrack.detectors.chosen import seen_by
    from handtrack.video.one_camera import SeenHand, believed_size, hand_seen

    detector, is_own = settings.detector, models.file is not None
    if stored and len(views.cameras) == 1:
        model = seen_by(models.of(views.hand), detector, views.seen_by)[0]
        return SeenHand(model, None, 0.0 if is_own else believed_size(1.0, None).deviation)
    model, method = models.subject(views.sequence(), settings.calibration.method)
    return hand_seen(views, model, method, detector, is_own)


def _say(followed: Followed, views: Views, median_px: float) -> None:
    """How well the hand explains the pictures."""
    name = followed.sequence.name
    for note in followed.sequence.notes:
        click.echo(f"warning: {name}: {note}", err=True)
    count = len(views.cameras)
    click.echo(
        f"{name}: {views.hand} hand in {count} view{'s' if count > 1 else ''}, reprojection error"
        f" {median_px:.2f} px (median)",
        err=True,
    )
