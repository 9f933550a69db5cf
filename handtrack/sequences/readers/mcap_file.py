"""MCAP files: joints that handtrack observed in recordings of its own, JSON messages, and robots'
logs (ROS 2, Foxglove, IsaacTeleop)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from handtrack.errors import InputError
from handtrack.mcap.hands import METADATA, OURS, STATE, HandDecoder, Hands
from handtrack.mcap.walk import Walk
from handtrack.sequences.readers import mcap_json
from handtrack.sequences.readers.catalogue import Format, Way
from handtrack.sequences.readers.raw import NotJointsError, Raw, stem
from handtrack.sequences.readers.robot_logs import Channel as Robot
from handtrack.sequences.readers.robot_logs import RobotLog, understood

if TYPE_CHECKING:
    from mcap.records import Channel


MCAP_MAGIC = b"\x89MCAP"


def read_mcap(path: Path) -> list[Raw]:
    """The sequences of an MCAP file: handtrack's own, robots' messages, or JSON joint messages.

    Only those messages are decoded: recordings hold meshes and pictures too.

    Raises:
        NotJointsError: no topic that is understood.
        InputError: damaged or cut short, or a message that does not fit.
    """
    walk = Walk(path)
    hands = Hands(walk)
    messages: list[mcap_json.Message] = []
    log = RobotLog(path)
    robots: dict[int, Robot] = {}

    def of_robots(channel: Channel) -> bool:
        # recordings of our own hold frames for viewers too
        own = METADATA in walk.metadata or hands.all
        return not own and understood(walk.schema_of(channel), channel.message_encoding)

    def wanted(channel: Channel) -> bool:
        ours = channel.message_encoding == "json" or walk.schema_of(channel) in OURS
        return ours or of_robots(channel)

    for found in walk.messages(wanted):
        if found.channel in robots:
            robots[found.channel].add(found.time, found.data)
            continue
        channel = walk.channels[found.channel]
        if of_robots(channel):
            schema = walk.definitions[channel.schema_id]
            about = channel.topic, schema.name, channel.message_encoding, schema.data
            robots[found.channel] = log.channel(*about)
            robots[found.channel].add(found.time, found.data)
        elif channel.message_encoding == "json":
            messages.append(mcap_json.Message(channel.topic, found.time, found.data))
        else:
            hands.add(found)
    if walk.cut:
        raise InputError(
            f"the MCAP file is damaged or cut short: {walk.cut};"
            " 'handtrack recover' makes a whole one of a recording of handtrack",
            path,
        )
    if METADATA in walk.metadata or hands.all:
        hands.check()
        found_hands = sorted((hand for hand in hands.all if hand.here), key=lambda h: h.topic)
        if not found_hands:
            raise InputError(f"a handtrack recording without {STATE} messages", path)
        return [_observed(hand, path) for hand in found_hands]
    raws = log.hands()
    if raws:
        return raws
    if messages:
        messages.sort(key=lambda message: message.log_time)
        return mcap_json.read(messages, path)
    if log.topics:
        return log.check()
    topics = [f"{c.topic} ({c.message_encoding})" for c in walk.channels.values()]
    if not topics:
        raise InputError("no messages in it", path)
    raise NotJointsError(f"no joint messages in it, topics are {', '.join(topics[:6])}", path)


def _observed(hand: HandDecoder, path: Path) -> Raw:
    """What was given to the tracker: observed joints, confidence and truth, not the fits."""
    frames = hand.take()
    truth = frames.truth
    return Raw(
        np.array(frames.observed),
        path,
        frames.name or f"{stem(path)} {hand.topic.strip('/')}".strip(),
        hand=frames.hand,
        unit="m",
        order="handtrack",
        time_ns=np.array(frames.time_ns),
        frame_index=np.array(frames.frame_index),
        confidence=np.array(frames.confidence),
        truth=None if truth is None else np.array(truth),
        subject=frames.head.subject,
    )


FORMATS = (
    Format(
        "handtrack's own MCAP",
        "the observed joints, to be tracked again",
        "handtrack",
        "m",
        "both",
        "its metadata",
        suffixes=(".mcap",),
        ways=(Way("file", lambda head, path: head.startswith(MCAP_MAGIC), read_mcap),),
    ),
)
