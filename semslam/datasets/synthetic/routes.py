"""The camera's way through the scenes: where it passes, and where it looks."""

from collections.abc import Sequence
from dataclasses import dataclass, replace


@dataclass(frozen=True, slots=True)
class Stop:
    """A place on the camera's way.

    Attributes:
        x: metres.
        y: metres.
        yaw: degrees in which it looks, counter-clockwise from +x; not wrapped, so that it states the turn's sense.
        pitch: degrees, positive upwards.
    """

    x: float
    y: float
    yaw: float
    pitch: float = -10.0


@dataclass(frozen=True, slots=True)
class Route:
    """A way that is passed twice.

    Attributes:
        stops: the first pass; unless the way goes back, the last stop is the first one again, but for whole turns.
        again: how many of them the second pass follows.
        back: whether the second pass begins at the last stop and goes back, looking ahead as the first one did.
    """

    stops: tuple[Stop, ...]
    again: int
    back: bool = False

    def both_passes(self) -> list[Stop]:
        """All stops of the first and the second pass, the turn's sense kept."""
        if self.back:
            return [*self.stops, *(replace(s, yaw=s.yaw + 180.0) for s in self.stops[::-1][: self.again])]
        turns = round((self.stops[-1].yaw - self.stops[0].yaw) / 360.0) * 360.0
        return [*self.stops, *(replace(stop, yaw=stop.yaw + turns) for stop in self.stops[1 : self.again])]


def shifted(stops: Sequence[Stop], x: float, y: float) -> tuple[Stop, ...]:
    """The same stops elsewhere."""
    return tuple(replace(stop, x=stop.x + x, y=stop.y + y) for stop in stops)


HOUSE = Route(
    (
        # The living room, from the bookcase along the television and the window to the archway.
        Stop(3.3, 2.6, 185), Stop(2.85, 2.4, 222), Stop(2.9, 1.5, 268), Stop(3.3, 1.6, 320), Stop(3.9, 2.5, 358),
        Stop(4.7, 2.95, 360), Stop(5.5, 3.0, 350),
        # The study, out by its own door, along the corridor.
        Stop(6.2, 2.9, 318), Stop(6.9, 2.5, 284), Stop(7.1, 2.4, 340), Stop(7.3, 2.6, 400), Stop(8.1, 3.1, 446),
        Stop(8.6, 3.7, 450), Stop(8.6, 4.5, 462), Stop(8.3, 4.85, 530), Stop(7.4, 4.85, 540), Stop(6.3, 4.85, 540),
        Stop(5.9, 4.85, 536), Stop(5.65, 5.15, 470),
        # The kitchen, with a look back from where it was entered.
        Stop(5.6, 5.8, 450), Stop(5.65, 6.5, 420), Stop(6.0, 7.4, 395), Stop(6.8, 8.05, 350), Stop(7.4, 8.1, 300),
        Stop(6.9, 8.0, 262), Stop(6.2, 7.5, 330), Stop(5.75, 6.7, 414), Stop(5.65, 6.5, 340), Stop(5.6, 5.9, 274),
        # The corridor, seen once more from where the kitchen was entered.
        Stop(5.6, 5.2, 232), Stop(5.8, 4.85, 182), Stop(5.0, 4.85, 180), Stop(4.0, 4.85, 178), Stop(3.4, 5.0, 120),
        # The bedroom, likewise, and the corridor again.
        Stop(3.2, 5.7, 92), Stop(3.15, 6.4, 110), Stop(3.0, 7.0, 160), Stop(3.0, 7.5, 186), Stop(2.9, 7.6, 222),
        Stop(2.95, 7.2, 160), Stop(3.1, 6.5, 114), Stop(3.15, 6.3, 200), Stop(3.2, 5.7, 266), Stop(3.4, 5.0, 232),
        Stop(3.9, 4.85, 184),
        # By its other door into the living room, to where it began.
        Stop(4.2, 4.75, 252), Stop(4.3, 4.1, 270), Stop(4.25, 3.4, 248), Stop(3.8, 2.9, 210), Stop(3.3, 2.6, 185),
    ),
    again=18,
)  # fmt: skip
"""Through the living room, the study, the corridor, the kitchen and the bedroom; then again to the kitchen's door."""

_STUDY_TOUR = (
    Stop(3.1, 3.3, 250), Stop(2.5, 2.7, 232), Stop(1.9, 2.5, 262), Stop(1.8, 2.3, 300), Stop(1.9, 2.3, 345),
    Stop(2.2, 2.5, 395), Stop(2.8, 3.0, 440), Stop(3.1, 3.5, 450),
)  # fmt: skip
TWIN_CORNERS = ((1.2, 0.0), (5.5, 0.0))
"""Where the twin rooms stand."""
TWINS = Route(
    (
        *shifted(_STUDY_TOUR, *TWIN_CORNERS[0]),
        Stop(4.34, 4.2, 424), Stop(4.65, 4.75, 374), Stop(6.4, 4.9, 360), Stop(8.2, 4.85, 320), Stop(8.6, 4.2, 270),
        *shifted(_STUDY_TOUR, *TWIN_CORNERS[1]),
        Stop(8.5, 4.85, 500), Stop(6.4, 4.9, 540), Stop(5.3, 4.9, 566), Stop(4.6, 4.8, 600), Stop(4.3, 4.2, 622),
        replace(_STUDY_TOUR[0], x=_STUDY_TOUR[0].x + TWIN_CORNERS[0][0], yaw=610),
    ),
    again=len(_STUDY_TOUR),
)  # fmt: skip
"""The same tour in both rooms, back into the first, and there a second time."""

ROOM = Route(
    (
        Stop(2.9, 2.9, 250), Stop(2.4, 2.7, 232), Stop(1.9, 2.5, 262), Stop(1.8, 2.3, 300), Stop(1.9, 2.3, 345),
        Stop(2.1, 2.4, 395), Stop(2.5, 2.6, 440), Stop(2.7, 2.6, 500), Stop(2.9, 2.9, 560), Stop(2.9, 2.9, 610),
    ),
    again=7,
)  # fmt: skip
"""Once around in one room."""

_HOUSE_THROUGH = (
    # The corridor, the living room from door to archway, the study from archway to door, the corridor, the kitchen.
    Stop(0.9, 4.85, 0), Stop(2.4, 4.85, 0), Stop(3.6, 4.8, -20), Stop(4.2, 4.5, -75), Stop(4.3, 3.9, -95),
    Stop(4.2, 3.4, -112), Stop(3.7, 2.8, -130), Stop(3.1, 2.3, -115), Stop(2.95, 1.7, -75), Stop(3.3, 1.6, -10),
    Stop(3.9, 2.3, 45), Stop(4.7, 2.95, 15), Stop(5.5, 3.0, -5), Stop(6.2, 2.9, -25), Stop(6.9, 2.5, -15),
    Stop(7.4, 2.6, 20), Stop(8.1, 3.1, 55), Stop(8.6, 3.7, 88), Stop(8.6, 4.5, 105), Stop(8.2, 4.85, 165),
    Stop(7.4, 4.85, 180), Stop(6.4, 4.85, 178), Stop(5.8, 5.0, 130), Stop(5.6, 5.6, 92), Stop(5.65, 6.4, 80),
    Stop(6.0, 7.3, 55), Stop(6.8, 8.0, 20), Stop(7.4, 8.1, -20),
)  # fmt: skip
HOUSE_BACK = Route(_HOUSE_THROUGH, len(_HOUSE_THROUGH), back=True)
"""Through the house, looking ahead; then the same way back."""

_TWINS_THROUGH = (
    Stop(1.6, 4.85, 0), Stop(3.2, 4.85, -5), Stop(4.1, 4.6, -55),
    *(replace(stop, yaw=stop.yaw - 360.0) for stop in shifted(_STUDY_TOUR, *TWIN_CORNERS[0])),
    Stop(4.34, 4.2, 80), Stop(4.6, 4.75, 30), Stop(6.4, 4.9, 0), Stop(8.0, 4.85, -20), Stop(8.55, 4.3, -80),
    *(replace(stop, yaw=stop.yaw - 360.0) for stop in shifted(_STUDY_TOUR, *TWIN_CORNERS[1])),
    Stop(8.6, 4.3, 90), Stop(8.55, 4.75, 120),
)  # fmt: skip
TWINS_BACK = Route(_TWINS_THROUGH, len(_TWINS_THROUGH), back=True)
"""The corridor and both rooms; then the same way back."""
ROOM_BACK = Route(ROOM.stops, len(ROOM.stops), back=True)
"""Once around in one room, and once around the other way."""
