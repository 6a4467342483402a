"""The rooms with all that stands in them. ``moved`` gives them after some things were moved or taken away."""

from semslam.datasets.synthetic import fittings, furniture, labels
from semslam.datasets.synthetic.catalog import stream
from semslam.datasets.synthetic.rooms import Opening, Room
from semslam.datasets.synthetic.shapes import sheet, soft_box

DOOR = (0.95, 2.08)
"""Width and height of an opening for a door, metres."""
PROPS = ("ceramic", "cloth_red", "cloth_blue", "leaves", "cushion_a", "oak")


def door_opening(side: str, along: float) -> Opening:
    """An opening for a door."""
    return Opening(side, along, DOOR[0], 0.0, DOOR[1])


def add_window(room: Room, side: str, along: float, width: float, height: float = 1.35, bottom: float = 0.9) -> Opening:
    """Put a window into a wall and give the opening that the wall needs."""
    room.against(side, along, *fittings.window(width, height, "view", "white_wood"), z=bottom)
    return Opening(side, along, width, bottom, bottom + height)


def add_picture(
    room: Room, side: str, along: float, z: float, size: tuple[float, float], image: str, frame: str
) -> None:
    """Hang a framed picture, its centre ``z`` metres above the floor."""
    room.against(side, along, fittings.picture(*size, image, frame), z=z)


def add_gallery(room: Room, side: str, along: float, z: float, images: tuple[str, ...]) -> None:
    """Hang small pictures in two rows, the middle of the group ``z`` metres above the floor."""
    columns = (len(images) + 1) // 2
    for k, image in enumerate(images):
        x = along + 0.34 * (k % columns - (columns - 1) / 2)
        add_picture(room, side, x, z + 0.2 - 0.4 * (k // columns), (0.26, 0.32), image, "white_wood")


def living_room(seed: int, moved: bool) -> Room:
    """Sofa, television, bookcase, armchair, rug; 5.4 x 4.0 m; a door in N, an archway in E."""
    room = Room(5.4, 4.0)
    openings = [add_window(room, "S", 3.9, 1.7), door_opening("N", 4.3), door_opening("E", 3.0)]
    room.shell("wall_living", "floor_oak", openings, {"W": "brick"})
    room.against("S", 3.9, fittings.curtains(1.7, 2.2, "curtain_living", "dark_wood"))
    room.against(
        "N", 1.55, furniture.sofa(2.1, "cloth_blue", ("cushion_a", "cushion_b", "cloth_red"), "dark_wood"), out=0.04
    )
    room.stand(1.55, 1.95, [sheet((0, 0, 0.008), 2.5, 1.7, "rug_living", labels.FLOOR_MAT)])
    coffee = (1.95, 1.8) if moved else (1.55, 1.75)
    room.stand(*coffee, furniture.table(1.05, 0.55, 0.42, "walnut"))
    books = fittings.book_row(stream(seed, "coffee"), 0.25, 0.2, "spines_0", "linen")
    room.stand(coffee[0] + 0.2, coffee[1] + 0.3, books, yaw=-90, z=0.42)
    if not moved:
        bowl = fittings.trinket(stream(seed, "bowl"), ("ceramic",), 0.2)
        room.stand(coffee[0] - 0.25, coffee[1] + 0.25, bowl, z=0.42)
    room.against("S", 1.45, furniture.cupboard(1.7, 0.45, 0.5, "walnut", "walnut", labels.CABINET, 3, 1), out=0.02)
    room.against("S", 1.45, furniture.monitor("screen_off", "dark", 1.05), out=0.12, z=0.5)
    room.against("W", 2.1, fittings.bookcase(stream(seed, "living"), 1.3, 2.0, "oak", "spines_0", "linen", PROPS))
    room.against("E", 1.25, furniture.sofa(0.95, "cloth_beige", ("cushion_b",), "oak", labels.CHAIR), out=0.1)
    room.against("W", 3.55, *fittings.floor_lamp("shade", "metal"), out=0.05)
    if not moved:
        room.against("S", 5.1, fittings.plant(stream(seed, "plant"), "brick", "leaves", 1.1), out=0.02)
    for k, x in enumerate((0.75, 1.55, 2.35)):
        add_picture(room, "N", x, 1.55, (0.62, 0.5 + 0.12 * (k % 2)), f"painting_{k}", "dark_wood")
    add_picture(room, "N", 3.25, 1.6, (0.7, 0.9), "poster_0", "oak")
    add_picture(room, "E", 1.25, 1.6, (1.1, 0.75), "painting_3", "walnut")
    add_picture(room, "S", 0.55, 1.75, (0.5, 0.65), "painting_4", "oak")
    add_picture(room, "S", 1.8, 1.7, (0.9, 0.45), "painting_5", "dark_wood")
    add_picture(room, "W", 0.75, 1.6, (0.8, 0.6), "painting_6", "white_wood")
    room.stand(2.7, 2.0, *fittings.ceiling_lamp(2.6, "shade"))
    return room


def study(seed: int, moved: bool, archway: bool = True, twin: bool = False) -> Room:
    """Desk, bookcases, whiteboard, boxes; 4.1 x 4.0 m; an archway in W unless it is walled up, a door in N.

    Its ``twin`` differs in little: the chair is turned, a picture is another one, a box and a vase are missing.
    """
    room = Room(4.1, 4.0)
    openings = [add_window(room, "E", 1.7, 1.5), door_opening("N", 3.1)]
    if archway:
        openings.append(door_opening("W", 3.0))
    else:
        add_gallery(room, "W", 2.7, 1.55, ("painting_15", "poster_0", "painting_17", "poster_5"))
    room.shell("wall_study", "floor_dark", openings)
    room.against("E", 1.7, fittings.blinds(1.5, 0.7, "white_wood"), z=1.55)
    room.against("E", 1.7, furniture.desk(1.6, "pine", "metal"), out=0.05)
    room.against("E", 1.85, furniture.monitor("screen_on", "dark"), out=0.15, z=0.74)
    room.against("E", 1.15, *fittings.table_lamp("shade", "metal"), out=0.3, z=0.74)
    room.against("E", 2.3, fittings.book_row(stream(seed, "desk"), 0.3, 0.3, "spines_1", "linen"), out=0.1, z=0.74)
    room.against("E", 1.6, [sheet((0, 0, 0.002), 0.3, 0.21, "poster_1", labels.PAPER)], out=0.6, z=0.742)
    yaw = -140 if moved else -100
    room.stand(2.75, 1.6, furniture.office_chair("cloth_black", "dark"), yaw=yaw + 25 * twin)
    for k, x in enumerate((0.62, 1.72)):
        books = fittings.bookcase(
            stream(seed, f"study_{k}"), 1.05, 2.1, "white_wood", f"spines_{1 + k}", "linen", PROPS
        )
        room.against("S", x, books)
    room.against("S", 2.85, furniture.cupboard(0.8, 0.42, 1.05, "cherry", "cherry", labels.CABINET, 1, 4))
    if not twin:
        room.against("S", 2.85, fittings.trinket(stream(seed, "vase"), ("ceramic",), 0.35), out=0.2, z=1.05)
    add_picture(room, "S", 2.9, 1.85, (0.55, 0.7), "poster_2", "dark_wood")
    room.against("N", 1.35, fittings.pinned(1.5, 0.95, "poster_3", labels.WHITEBOARD), z=1.5)
    add_picture(room, "W", 1.1, 1.65, (0.8, 1.05), "painting_7", "oak")
    add_picture(room, "E", 3.3, 1.6, (0.6, 0.8), "painting_12" if twin else "painting_8", "white_wood")
    add_picture(room, "E", 0.4, 1.6, (0.45, 0.6), "painting_9", "white_wood")
    stack = (0.35, 1.35) if moved else (0.35, 0.95)
    room.stand(*stack, fittings.carton_box(0.5, 0.4, 0.36, "carton"), yaw=-84)
    if not (moved or twin):
        room.stand(0.42, 0.95, fittings.carton_box(0.36, 0.3, 0.26, "carton"), yaw=-100, z=0.36)
    room.against(
        "N", 2.25, [soft_box((0, 0.14, 0.2), (0.36, 0.2, 0.4), "cloth_green", labels.BAG, 0.08, 0.02)], out=0.05
    )
    room.stand(2.05, 2.0, *fittings.ceiling_lamp(2.6, "shade"))
    return room


def kitchen(seed: int, moved: bool) -> Room:
    """Kitchen units, fridge, dining table with chairs, a shelf; 5.1 x 3.7 m; a door in S."""
    room = Room(5.1, 3.7)
    openings = [add_window(room, "E", 1.5, 1.5), door_opening("S", 1.1)]
    room.shell("wall_kitchen", "floor_tiles", openings)
    room.against("N", 3.5, furniture.kitchen_unit(2.8, "cherry", "cherry", "worktop", "splash"))
    room.against("N", 1.7, furniture.refrigerator("enamel", "metal"), out=0.02)
    for k, x in enumerate((2.5, 2.85, 3.6, 4.6)):
        room.against("N", x, fittings.trinket(stream(seed, f"jar_{k}"), PROPS, 0.3), out=0.2, z=0.905)
    room.stand(3.1, 0.62, furniture.table(1.5, 0.85, 0.74, "oak"))
    for k, x in enumerate((2.7, 3.5)):
        room.stand(x, 0.4, furniture.chair("oak", "cloth_green"))
        out = 2.05 if moved and k else 1.72
        room.stand(x, out, furniture.chair("oak", "cloth_green"), yaw=180 + (35 if moved and k else 4))
    room.stand(3.1, 1.05, fittings.trinket(stream(seed, "table"), ("ceramic",), 0.3), z=0.74)
    if not moved:
        room.stand(3.5, 0.95, fittings.carton_box(0.24, 0.16, 0.2, "carton"), z=0.74, yaw=20)
    room.against("W", 2.4, fittings.bookcase(stream(seed, "kitchen"), 1.1, 1.7, "pine", "spines_0", "linen", PROPS))
    add_picture(room, "W", 1.1, 1.6, (0.7, 0.9), "painting_10", "oak")
    add_picture(room, "S", 3.1, 1.6, (1.2, 0.8), "painting_11", "dark_wood")
    add_picture(room, "S", 2.05, 1.6, (0.5, 0.7), "poster_4", "oak")
    add_picture(room, "S", 4.5, 1.6, (0.6, 0.6), "painting_12", "white_wood")
    add_picture(room, "E", 3.0, 1.65, (0.5, 0.7), "poster_5", "white_wood")
    room.against("N", 0.7, fittings.plant(stream(seed, "kitchen plant"), "ceramic", "leaves", 1.3), out=0.1)
    room.stand(3.1, 1.05, *fittings.ceiling_lamp(2.6, "shade"))
    return room


def bedroom(seed: int, moved: bool) -> Room:
    """Bed, night stands, wardrobe, dresser; 4.4 x 3.7 m; a door in S."""
    room = Room(4.4, 3.7)
    openings = [add_window(room, "N", 1.6, 1.6), door_opening("S", 3.2)]
    room.shell("wall_bedroom", "floor_pale", openings)
    room.against("N", 1.6, fittings.curtains(1.6, 2.2, "curtain_bedroom", "dark_wood"))
    room.against("W", 1.85, furniture.bed(1.5, "walnut", "linen", "quilt", "linen"), out=0.02)
    for y in (0.72, 2.98):
        room.against("W", y, furniture.cupboard(0.48, 0.4, 0.5, "walnut", "walnut", labels.NIGHT_STAND, 1, 2), out=0.02)
        room.against("W", y, *fittings.table_lamp("shade", "ceramic"), out=0.22, z=0.5)
    room.against("E", 2.2, furniture.cupboard(1.9, 0.58, 2.15, "pine", "pine", labels.CABINET, 3))
    room.against("N", 3.25, furniture.cupboard(1.0, 0.46, 0.85, "white_wood", "white_wood", labels.DRESSER, 2, 3))
    room.against("N", 3.0, fittings.trinket(stream(seed, "dresser"), ("cloth_red",), 0.3), out=0.25, z=0.85)
    if not moved:
        room.against("N", 3.45, fittings.carton_box(0.3, 0.2, 0.2, "carton"), out=0.1, z=0.85)
    add_picture(room, "N", 3.25, 1.6, (0.75, 0.55), "painting_13", "walnut")
    room.stand(2.5, 1.85, [sheet((0, 0, 0.008), 1.5, 2.2, "rug_bedroom", labels.FLOOR_MAT)])
    add_picture(room, "W", 1.4, 1.65, (0.65, 0.5), "painting_14", "walnut")
    add_picture(room, "W", 2.3, 1.65, (0.65, 0.5), "painting_15", "walnut")
    add_picture(room, "S", 1.2, 1.6, (1.0, 0.7), "painting_16", "oak")
    add_picture(room, "S", 2.2, 1.65, (0.5, 0.7), "poster_6", "white_wood")
    add_picture(room, "E", 0.6, 1.6, (0.55, 0.75), "painting_17", "oak")
    room.against("S", 1.9 if moved else 1.35, furniture.chair("pine", "cloth_red"), out=0.08)
    room.stand(2.3, 1.85, *fittings.ceiling_lamp(2.6, "shade", 1.2))
    return room


def corridor(seed: int, moved: bool) -> Room:
    """A corridor of 9.6 x 1.5 m with a window at its W end and doors to all rooms."""
    room = Room(9.6, 1.5)
    openings = [add_window(room, "W", 0.75, 0.8), door_opening("N", 3.2), door_opening("N", 5.6)]
    openings += [door_opening("S", 4.3), door_opening("S", 8.6)]
    room.shell("wall_corridor", "floor_oak", openings)
    room.stand(6.6, 0.75, [sheet((0, 0, 0.008), 3.4, 0.8, "runner", labels.FLOOR_MAT)])
    room.stand(1.9, 0.75, [sheet((0, 0, 0.008), 2.4, 0.8, "runner", labels.FLOOR_MAT)])
    room.against("S", 6.5, furniture.cupboard(1.1, 0.28, 0.8, "oak", "oak", labels.CABINET, 3))
    room.against("S", 6.2, fittings.trinket(stream(seed, "hall"), ("ceramic",), 0.4), out=0.14, z=0.8)
    room.against("S", 1.6, fittings.bookcase(stream(seed, "hall case"), 1.0, 1.2, "walnut", "spines_2", "linen", PROPS))
    room.against("E", 0.75, furniture.cupboard(0.9, 0.4, 0.9, "walnut", "walnut", labels.DRESSER, 2, 3))
    room.against("N", 8.6, fittings.bookcase(stream(seed, "hall low"), 1.3, 1.05, "oak", "spines_1", "linen", PROPS))
    add_gallery(room, "N", 8.6, 1.6, ("poster_1", "poster_4", "painting_3", "poster_6", "painting_12", "poster_2"))
    add_gallery(room, "S", 3.1, 1.35, ("poster_6", "painting_10", "poster_0", "poster_1"))
    add_picture(room, "E", 0.75, 1.6, (0.8, 0.8), "painting_2", "oak")
    for x, image in (
        (1.2, "painting_5"),
        (2.2, "poster_7"),
        (4.4, "painting_9"),
        (6.7, "painting_11"),
        (7.6, "poster_3"),
    ):
        add_picture(room, "N", x, 1.55, (0.6, 0.75 - 0.05 * (x % 2)), image, "dark_wood")
    for x, image in (
        (0.7, "painting_13"),
        (2.2, "painting_1"),
        (5.5, "poster_5"),
        (6.6, "painting_8"),
        (7.6, "painting_16"),
    ):
        add_picture(room, "S", x, 1.6, (0.65, 0.5), image, "oak")
    if not moved:
        room.against("N", 7.3, [soft_box((0, 0.12, 0.2), (0.34, 0.2, 0.4), "cloth_red", labels.BAG, 0.08, 0.02)])
    for x in (2.3, 7.0):
        room.stand(x, 0.75, *fittings.ceiling_lamp(2.6, "shade", 1.3))
    return room
