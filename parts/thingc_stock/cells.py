"""Cells of size 18650, and an open tray for several cells side by side."""

from __future__ import annotations

from typing import Annotated

from build123d import Axis, Face, Location, Plane, Pos, Solid, Wire

from thingc import MATE, Count, Length, MountPoint, Range, Thing
from thingc_stock.fasteners import Screw


class Cell18650(Thing):
    """A lithium-ion cell of size 18650, Samsung SDI ICR18650-26C: 2600 mAh, 3.7 V.

    The origin is in the middle of the cell; z points to the positive pole.

    The specification of product ICR18650-26C, version 1.0, allows at most 18.40 mm in diameter, 65.00 mm in length and 47.0 g. The solid
    has no cavities, so thingc scales its inertia to the mass in the specification.

    Mounts: `plus` and `minus` are on the poles, and `side` is on the cylindrical surface at half the length.

    Args:
        diameter: diameter of the can
        length: length including both poles
    """

    bom = {"make": "buy", "number": "ICR18650-26C", "supplier": "Samsung SDI"}

    def __init__(
        self, diameter: Annotated[Length, Range(17, 20)] = 18.4, length: Annotated[Length, Range(64, 66)] = 65.0,
    ):
        super().__init__(material="steel", color="#2e6f57")
        end = length / 2
        self.plus = MountPoint(Location((0, 0, end)))
        self.minus = MountPoint(Location((0, 0, -end), (0, 180, 0)))
        self.side = MountPoint(Location(Plane((0, -diameter / 2, 0), x_dir=(0, 0, 1), z_dir=(0, -1, 0))), "18650")

    def mass(self) -> tuple[float, str]:
        """Return the mass of 47.0 g, which is the maximum in the specification."""
        return (0.047, "vendor")

    def hull(self) -> Solid:
        """Return the cylinder of the can without its groove."""
        return Solid.make_cylinder(self.p.diameter / 2, self.p.length, Plane((0, 0, -self.p.length / 2)))

    def result(self) -> Solid:
        """Return the solid of the can with the groove below its positive pole, and the rim around the pole."""
        radius, end = self.p.diameter / 2, self.p.length / 2
        outline = [
            (0, -end), (radius, -end),
            (radius, end - 4.0), (radius - 0.8, end - 3.5), (radius - 0.8, end - 3.0), (radius, end - 2.5),
            (radius, end - 0.5), (radius - 1.5, end - 0.5), (radius - 1.5, end - 1.5), (4.0, end - 1.5), (4.0, end), (0, end),
        ]
        return Solid.revolve(Face(Wire.make_polygon([(x, 0, z) for x, z in outline])), 360, Axis.Z)

    def collision(self) -> list[Solid]:
        """Return the collision shape: the cylinder of the can."""
        return [self.hull()]


class CellTray(Thing):
    """An open tray for several cells side by side, with screws through the ridges between the cells.

    The origin is in the middle of the underside; z points up, and the cells are along x.

    Mounts: `base` is on the underside of the tray. `bay_0`, `bay_1` ... are for the attachment of the cells at their cylindrical surfaces.
    The positive poles point alternately to +x and to -x, because the cells are in series. `screw_0` and `screw_1` are for the attachment of
    the screws at their heads.

    Args:
        cells: number of cells
        wall: thickness under and around the cells
        contact: space for the spring at each end of a cell
    """

    bom = {"make": "buy"}

    def __init__(
        self,
        cells: Annotated[Count, Range(2, 4)] = 3,
        wall: Annotated[Length, Range(1, 3)] = 1.5,
        contact: Annotated[Length, Range(2, 5)] = 3.0,
    ):
        super().__init__(material="abs", color="#1d1d1f")
        cell = Cell18650()
        play = 0.2
        pitch = cell.p.diameter + 2 * play + 0.4
        self.length = cell.p.length + 2 * (contact + wall)
        self.width = cells * pitch + 2 * wall
        self.height = wall + 0.7 * cell.p.diameter
        self.top = wall + cell.p.diameter
        across = [(k - (cells - 1) / 2) * pitch for k in range(cells)]

        self.base = MountPoint(MATE)
        # the `side` of each cell points down, and every second cell is reversed
        self.bay = [
            MountPoint(Location(Plane((0, y, wall), x_dir=(0, -1 if k % 2 else 1, 0), z_dir=(0, 0, 1))), "18650")
            for k, y in enumerate(across)
        ]
        self.cell: list[Cell18650] = [bay.align(cell.side) for bay in self.bay]
        ridges = [(x, (across[k] + across[k + 1]) / 2) for x, k in ((-0.3 * self.length, 0), (0.3 * self.length, cells - 2))]
        self.screw = [MountPoint(Location((x, y, wall)), "m2.5-head") for x, y in ridges]

        block = Solid.make_box(self.length, self.width, self.height, Plane((-self.length / 2, -self.width / 2, 0)))
        roomy = cell.adjust(diameter__add=2 * play)
        # the bed ends at the wall, because the clearance is above and beside the cell
        beds = [(Pos(0, y, wall + roomy.p.diameter / 2) * Location((0, 0, 0), (0, 90, 0))) * roomy.hull() for y in across]
        springs = [
            Solid.make_box(contact, 0.6 * pitch, self.height, Plane((x - contact / 2, y - 0.3 * pitch, wall)))
            for y in across for x in ((cell.p.length + contact) / 2, -(cell.p.length + contact) / 2)
        ]
        holes = [self.fixing(k, wall).clearance_hull for k in range(2)]
        self.body = block.cut(*beds, *springs, *holes).solid()

    def fixing(self, number: int, depth: float) -> Screw:
        """Return screw 0 or 1 through the bottom wall, which extends `depth` [mm] into the part below the tray."""
        return Screw("M2.5", self.p.wall + depth).move(self.screw[number].location)

    def result(self) -> Solid:
        """Return the solid of a block with a bed for each cell, space for the springs, and holes for the screws."""
        return self.body

    def envelope(self) -> Solid:
        """Return the solid of the tray together with the cells."""
        return Solid.make_box(self.length, self.width, self.top, Plane((-self.length / 2, -self.width / 2, 0)))


class Pack2S(Thing):
    """A pack of two lithium cells in series, ProModeler B2S2500: 2500 mAh, 7.4 V.

    The page www.promodeler.com/B2S2500 lists 66 x 36 x 18 mm and 107 g. The origin is in the middle of the underside; x is along the cells,
    and z up.

    Mounts: `bottom` and `top` are on the flat faces, and `lead` is on the end with the cables (+x).
    """

    bom = {"make": "buy", "number": "B2S2500", "supplier": "ProModeler"}

    def __init__(self) -> None:
        super().__init__(material="abs", color="#2f5fa8")
        self.size = (66.0, 36.0, 18.0)
        self.bottom = MountPoint(Location(Plane((0, 0, 0), x_dir=(-1, 0, 0), z_dir=(0, 0, -1))))
        self.top = MountPoint(Location((0, 0, self.size[2])))
        self.lead = MountPoint(Location((self.size[0] / 2, 0, self.size[2] / 2), (0, 90, 0)))

    def mass(self) -> tuple[float, str]:
        """Return the mass of 107 g from the manufacturer's page."""
        return (0.107, "vendor")

    def result(self) -> Solid:
        """Return the solid of two round cells side by side in a sleeve."""
        length, width, height = self.size
        radius = height / 2
        across = width / 2 - radius
        cells = [Solid.make_cylinder(radius, length, Plane((-length / 2, y, radius), z_dir=(1, 0, 0))) for y in (across, -across)]
        return Solid.make_box(length, 2 * across, height, Plane((-length / 2, -across, 0))).fuse(*cells).solid()

    def collision(self) -> list[Solid]:
        """Return the collision shape: the bounding box."""
        return [Solid.make_box(*self.size, Plane((-self.size[0] / 2, -self.size[1] / 2, 0)))]
