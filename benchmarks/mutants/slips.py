"""Two lists of user mistakes (slips) in valid documents of three robots. The 120 slips in the first list change the meaning of the
document, and the 60 slips in the second list concern magnitudes, units and positions.

The lists were written before thingc was run on any of the slips. The slips cover everything that a user writes in a document: components,
mates, joints, drives, poses, modes and numbers. The lists are not changed later. If thingc reports a slip, or if a slip turns out to be
valid, this is a result of the study.

An edit has the form `path: text` or `-path`. The first form replaces the value at the path or adds an entry, and the second form removes
the entry. A path consists of the name of the document, a space, and keys that are separated by `/`.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Slip:
    """A mistake of a user. `robot` is the document to build, and `edits` are the changes of its documents."""

    robot: str
    kind: str
    edits: tuple[str, ...]


def _of(robot: str, kind: str, *slips: str | tuple[str, ...]) -> list[Slip]:
    return [Slip(robot, kind, (slip,) if isinstance(slip, str) else slip) for slip in slips]


ARM, MINCHW, WALKER = "arm", "minchw", "walker"

MEANING: list[Slip] = [
    # --- the arm
    *_of(
        ARM, "wrong sign",
        "arm poses/home/wrist: 30 deg",
        "arm poses/writing/wrist: 58.8 deg",
        "arm joints/shoulder/turn: -90 deg",
        ("arm joints/shoulder/limit/lower: -10 deg", "arm joints/shoulder/limit/upper: 170 deg"),
        "arm modes/adrift/at/xyz: 0 0 -300 mm",
        "arm components/bus_board/at/xyz: 0 0 -4 mm",
        "arm modes/bench/gravity: 0 0 9.81 m/s^2",
    ),
    *_of(
        ARM, "wrong mount of the right component",
        "arm components/yaw_servo/attach: {front: plate.servo_seat}",
        "arm components/yaw_servo/attach: {bottom: plate.servo_seat}",
        "arm components/shoulder_servo/attach: {top: bracket.shoulder_seat}",
        "arm components/elbow_servo/attach: {back: humerus.servo_seat}",
        "arm joints/yaw/parent: yaw_servo.idler",
        "arm joints/elbow/parent: elbow_servo.idler",
        "arm joints/wrist/child: hand.tip",
        "arm joints/elbow/child: forearm.servo_seat",
        "end_effector components/pen/attach: {tip: cap.pen}",
        "end_effector components/cap/attach: {pen: fixture.cap_seat}",
        "end_effector mounts/tip: pen.grip",
    ),
    *_of(
        ARM, "wrong component",
        "arm components/shoulder_servo/attach: {bottom: humerus.servo_seat}",
        "arm components/wrist_servo/attach: {bottom: humerus.servo_seat}",
        "arm components/forearm_idler/attach/to: elbow_servo.bottom",
        "arm components/plate_screw/attach: {seat: plate.table_0}",
        "arm joints/elbow/drive: shoulder_servo",
        "arm joints/wrist/drive: elbow_servo",
        "arm modes/bench/root: bracket",
        "arm modes/drawing/root: hand.seat",
        "end_effector components/cap_screw/attach: {seat: cap.screw_0}",
    ),
    *_of(
        ARM, "wrong type of joint",
        ("arm joints/yaw/type: prismatic", "arm joints/yaw/limit: {lower: -150 mm, upper: 150 mm}"),
        ("arm joints/wrist/type: continuous", "-arm joints/wrist/limit"),
        ("arm joints/elbow/type: fixed", "-arm joints/elbow/limit", "-arm joints/elbow/drive"),
    ),
    *_of(
        ARM, "duplicate part",
        "arm components/humerus_copy: {part: arm:RotorBrace, params: {length: =reach, thickness: =brace_thickness}, "
        "at: {in: humerus.origin, xyz: 0 0 3 mm}}",
        "arm components/spare_servo: {part: thingc_stock.dynamixel:XM430, attach: {bottom: humerus.servo_seat}}",
        "end_effector components/pen_2: {part: arm:PenDummy, params: {length: =pen_length, diameter: =pen_diameter}, "
        "material: resin, attach: {grip: cap.pen}}",
        "arm components/plate_2: {part: arm:BasePlate, at: {in: plate.origin}}",
    ),
    *_of(
        ARM, "omitted entry",
        "-arm components/humerus_idler/attach/turn",
        "-arm joints/shoulder/turn",
        "-arm joints/wrist/drive",
        "-arm components/forearm_idler",
        "-arm modes/adrift/at",
    ),
    *_of(
        ARM, "wrong value of the right kind",
        "arm modes/bench/base: free",
        "arm modes/drawing/pose: folded",
        "arm components/plate_screw/repeat: {count: 4, as: i}",
        "arm components/bus_board/at: {in: plate.origin, xyz: 4 0 0 mm}",
        "arm simulation/integrator: euler",
        "arm defaults/component/collision: hull",
    ),
    # --- MInchW
    *_of(
        MINCHW, "wrong sign",
        "minchw poses/arched/*.knee: -100 deg",
        "minchw poses/step_front/rear.knee: -56 deg",
        "minchw poses/step_rear/front.ankle: -45 deg",
        "leg components/thigh_idler/attach/turn: -90 deg",
        "minchw components/harness/at/xyz: -40 0 -20 mm",
        ("leg joints/ankle/limit/lower: -125 deg", "leg joints/ankle/limit/upper: 46 deg"),
        "minchw modes/crawl_ceiling/gravity: 0 0 -9.81 m/s^2",
        "minchw modes/front_foot/at: {xyz: 0 0 -64 mm}",
    ),
    *_of(
        MINCHW, "wrong mount of the right component",
        "minchw components/rear/attach: {seat: body.front_seat}",
        "minchw components/cover/attach: {lens: body.rim}",
        "minchw components/cover_tray/attach: {base: cover.seat}",
        "minchw components/tray/attach: {base: body.belly}",
        "leg joints/yaw/parent: yaw_servo.idler",
        "leg joints/knee/child: thigh.ankle_seat",
        "leg joints/ankle/parent: thigh.knee_seat",
        "leg components/knee_servo/attach: {top: hip.knee_seat}",
        "leg components/magnet/attach: {sole: foot.magnet_seat}",
        "leg components/foot/attach: {magnet_seat: ankle_servo.bottom}",
        "leg mounts/sole: magnet.back",
        "minchw mounts/lens: cover.seat",
    ),
    *_of(
        MINCHW, "wrong component",
        "minchw components/cover_cell/attach: {side: tray.bay_$i}",
        "leg joints/ankle/drive: knee_servo",
        "leg components/thigh_idler_screw/attach: {seat: thigh.screw_0}",
        "minchw modes/rear_foot/root: front.sole",
        "minchw modes/crawl/root: cover",
        "minchw modes/front_foot/contacts: {adhesion: {rear.sole: 300 N}}",
        "minchw modes/bridge_wall/extends: front_foot",
    ),
    *_of(
        MINCHW, "wrong type of joint",
        ("leg joints/yaw/type: continuous", "-leg joints/yaw/limit"),
        ("leg joints/knee/type: prismatic", "leg joints/knee/limit: {lower: -115 mm, upper: 115 mm}"),
        ("leg joints/yaw/type: fixed", "-leg joints/yaw/limit", "-leg joints/yaw/drive"),
    ),
    *_of(
        MINCHW, "duplicate part",
        "minchw components/cover_2: {part: minchw.body:Cover, params: {length: =body_length, wall: =wall}, attach: {seat: body.rim}}",
        "leg components/foot_2: {part: minchw.leg:Foot, params: {thickness: =wall + 2 mm}, material: petg_white, "
        "at: {in: foot.origin, xyz: 0 3 0 mm}}",
        "minchw components/cell_extra: {part: thingc_stock.cells:Cell18650, attach: {side: tray.bay_1}, collision: none}",
        "leg components/magnet_2: {part: thingc_stock.magnets:HoldingMagnet, attach: {back: foot.magnet_seat}}",
        "minchw components/middle: {assembly: leg.yaml, attach: {seat: body.rear_seat}}",
    ),
    *_of(
        MINCHW, "omitted entry",
        "-leg joints/ankle/drive",
        "-minchw modes/crawl/pose",
        "-minchw components/body/mass",
        "-leg components/thigh_idler/attach/turn",
        "-minchw modes/rear_foot/at",
    ),
    *_of(
        MINCHW, "wrong value of the right kind",
        "minchw modes/front_foot/base: free",
        "minchw modes/crawl/base: fixed",
        "minchw modes/front_foot/pose: step_rear",
        "minchw components/cover_cell/repeat: {count: 2, as: i}",
        "minchw components/magnet_driver/at: {in: body.origin, xyz: 20 0 4 mm}",
    ),
    # --- the walker of the language reference
    *_of(
        WALKER, "wrong sign",
        "walker poses/low/hip_*: -10 deg",
        ("leg joints/knee/limit/lower: -10 deg", "leg joints/knee/limit/upper: 120 deg", "leg poses/folded/knee: 110 deg"),
        "walker components/board/at/xyz: 0 0 -24 mm",
        "walker modes/walking/gravity: 0 0 9.81 m/s^2",
        "walker modes/walking/at: {xyz: 0 0 -150 mm}",
    ),
    *_of(
        WALKER, "wrong mount of the right component",
        "walker joints/hip/parent: body.head",
        "walker joints/hip/child: leg_$i.sole",
        "leg joints/knee/parent: thigh.tail",
        "leg joints/knee/child: shin.tail",
        "leg mounts/sole: shin.tail",
        "leg mounts/hip: thigh.head",
        "walker modes/perched/root: leg_0.hip",
    ),
    *_of(
        WALKER, "wrong component",
        "walker joints/hip/parent: body.top_0",
        "walker modes/two_feet/hold: {leg_0.sole: here}",
        "walker components/board/at/in: leg_0.hip",
        "walker modes/walking/root: leg_0.sole",
        "leg mounts/hip: shin.top_0",
    ),
    *_of(
        WALKER, "wrong type of joint",
        ("walker joints/hip/type: continuous", "-walker joints/hip/limit"),
        ("leg joints/knee/type: fixed", "-leg joints/knee/limit", "-leg joints/knee/drive", "-leg poses/folded/knee"),
    ),
    *_of(
        WALKER, "duplicate part",
        "leg components/shin_2: {part: toy:Beam, params: {length: \"=max(length, 60 mm)\"}, at: {in: shin.origin, xyz: 0 0 3 mm}}",
        "walker components/body_2: {part: toy:Beam, params: {length: 150 mm, width: 40 mm}, at: {in: body.origin}}",
        "walker components/leg_extra: {assembly: leg.yaml, attach: {hip: body.top_1}}",
    ),
    *_of(
        WALKER, "omitted entry",
        "-walker joints/hip/drive",
        "-walker modes/walking/contacts/exclude",
        "-leg joints/knee/drive",
    ),
    *_of(
        WALKER, "wrong value of the right kind",
        "walker modes/walking/base: fixed",
        "walker modes/walking/pose: low",
        "walker modes/perched/base: free",
        "walker joints/hip/drive/kind: velocity",
        "walker components/leg/parameters: {length: =80 mm + 50 mm * i}",
    ),
]

SIZES: list[Slip] = [
    *_of(
        ARM, "magnitude",
        "arm components/bus_board/mass: {value: 12 kg, source: measured}",
        "arm components/bus_board/at/xyz: 0 0 400 mm",
        "arm joints/yaw/limit/upper: 1500 deg",
        "arm joints/elbow/limit: {lower: -13 deg, upper: 130 deg}",
        "arm defaults/joint/dynamics/damping: 20 N*m*s/rad",
        "arm defaults/joint/dynamics/friction: 3 N*m",
        "arm simulation/timestep: 20 ms",
        "materials materials/petg/density: 127 kg/m^3",
    ),
    *_of(
        ARM, "unit",
        "arm joints/yaw/limit/upper: 150 rad",
        "arm joints/shoulder/limit/lower: -170 rad",
        "arm components/bus_board/at/xyz: 0 0 4 m",
        "arm modes/adrift/at/xyz: 0 0 300 m",
        "arm components/bus_board/mass: {value: 12 mg, source: measured}",
        "arm joints/shoulder/turn: 90 rad",
        "arm simulation/timestep: 2 s",
        "materials materials/petg/density: 1.27 kg/m^3",
    ),
    *_of(
        ARM, "position",
        "arm components/bus_board/at/xyz: 4 0 0 mm",
        "arm modes/adrift/at/xyz: 300 0 0 mm",
        "arm modes/bench/at: {xyz: 0 0 -50 mm}",
        "arm components/humerus_idler/attach: {mount: servo_seat, to: elbow_servo.bottom, turn: 180 deg, gap: -10 mm}",
        "arm components/elbow_servo/attach: {mount: bottom, to: humerus.servo_seat, gap: 100 mm}",
        "end_effector components/cap_screw/attach: {mount: seat, to: cap.screw_$i, gap: -20 mm}",
    ),
    *_of(
        MINCHW, "magnitude",
        "minchw components/controller/mass: {value: 460 kg, source: estimated}",
        "minchw components/harness/at/xyz: -400 0 20 mm",
        "minchw modes/front_foot/contacts/adhesion/front.sole: 30 N",
        "minchw modes/front_foot/contacts/adhesion/front.sole: 300000 N",
        "leg joints/knee/limit/upper: 1150 deg",
        "leg defaults/joint/dynamics/damping: 50 N*m*s/rad",
        "minchw simulation/timestep: 0.02 s",
        "minchw components/body/mass/value: =64 kg * (body_length / 94.7 mm)",
    ),
    *_of(
        MINCHW, "unit",
        "minchw modes/front_foot/contacts/adhesion/front.sole: 300 mN",
        "minchw modes/crawl_wall/contacts/adhesion/rear.sole: 300 kN",
        "minchw components/controller/at/xyz: 0 0 4 cm",
        "minchw components/magnet_driver/at/xyz: 20 0 4 m",
        "minchw components/harness/mass/value: 36 kg",
        "leg joints/ankle/limit/upper: 125 rad",
        "leg joints/yaw/limit: {lower: -90 deg, upper: 1.57 rad}",
        "materials materials/aluminium/density: 2.7 kg/m^3",
    ),
    *_of(
        MINCHW, "position",
        "minchw modes/bridge/hold/rear.sole/xyz/2: -8 mm",
        "minchw modes/rear_foot/at: {xyz: 0 0 -200 mm, rpy: 0 0 180 deg}",
        "minchw modes/front_foot/at: {rpy: 0 90 0 deg}",
        "leg components/magnet/attach: {mount: back, to: foot.magnet_seat, gap: -8 mm}",
        "minchw components/cover/attach: {mount: seat, to: body.rim, gap: -20 mm}",
        "minchw components/harness/at/xyz: 20 0 -40 mm",
    ),
    *_of(
        WALKER, "magnitude",
        "walker components/body/params: {length: 1500 mm, width: 40 mm}",
        "walker components/board/mass/value: 25 kg",
        "walker modes/walking/contacts/adhesion/leg_0.sole: 0.3 N",
        "walker joints/hip/drive: {kind: position, kp: 10000 N*m/rad, effort: 2 N*m}",
        "leg joints/knee/drive: {kind: position, kp: 10 N*m/rad, effort: 2000 N*m, velocity: 50 rpm}",
    ),
    *_of(
        WALKER, "unit",
        "walker joints/hip/limit: {lower: -45 rad, upper: 45 rad}",
        "walker components/board/at/xyz: 0 0 24 m",
        "walker components/body/params: {length: 150 cm, width: 40 cm}",
        "leg parameters/length: {value: 80 cm, min: 40 mm}",
        "leg joints/knee/drive: {kind: position, kp: 10 N*m/rad, effort: 2 N*m, velocity: 50 rad/s}",
        "materials materials/pla/density: 1240 g/m^3",
    ),
    *_of(
        WALKER, "position",
        "walker components/board/at/xyz: 24 0 0 mm",
        "walker modes/walking/at: {rpy: 180 0 0 deg}",
        "walker joints/hip/gap: -15 mm",
        "leg joints/knee/gap: -20 mm",
        "walker modes/walking/at: {xyz: 0 0 5 mm}",
    ),
]
