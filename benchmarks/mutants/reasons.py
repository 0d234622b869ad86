"""Reasons why thingc reports nothing for a slip, by its first edit: the text may be intended, or nothing shows that it is wrong."""

from __future__ import annotations

POSE = "A pose within the limits, in which nothing touches: only its author knows another one was meant."
FRAME = "A mass without a shape, within the robot: nothing says where it is, or weighs, otherwise."
RANGE = "A joint may turn so far."
MODE = "A mode may be so: it only differs from what was asked for."
PASSIVE = "A joint without a drive is a passive one, which robots have."
MOUNT = "Any mount of a part is a place where something may sit, and it hangs together."

REASONS: dict[str, str] = {
    # --- what is meant: the arm
    "arm poses/home/wrist: 30 deg": POSE,
    "arm components/bus_board/at/xyz: 0 0 -4 mm": FRAME,
    "arm joints/wrist/type: continuous": RANGE,
    "-arm joints/shoulder/turn": "The zero of a joint is the author's choice; the poses stay within the limits.",
    "-arm components/forearm_idler": "A robot without this cap is a robot.",
    "arm components/plate_screw/repeat: {count: 4, as: i}": "Not every hole needs a screw.",
    "arm components/bus_board/at: {in: plate.origin, xyz: 4 0 0 mm}": FRAME,
    "arm simulation/integrator: euler": "The gains are calm with this integrator, too.",
    "arm defaults/component/collision: hull": "A simulation may touch hulls.",
    # --- MInchW
    "minchw poses/step_front/rear.knee: -56 deg": POSE,
    "minchw poses/step_rear/front.ankle: -45 deg":
        "A pose within the limits, in which no mode starts. Where parts meet, a test of the document says it.",
    "minchw components/harness/at/xyz: -40 0 -20 mm": FRAME,
    "minchw modes/crawl_ceiling/gravity: 0 0 -9.81 m/s^2": "Gravity as on the floor, in a mode that is only called `ceiling`.",
    "leg joints/yaw/type: continuous": RANGE,
    "-leg components/thigh_idler/attach/turn": "The part sits in its seat, turned otherwise.",
    "-minchw modes/rear_foot/at": MODE,
    "minchw modes/crawl/base: fixed": MODE,
    "minchw modes/front_foot/pose: step_rear": MODE,
    "minchw components/magnet_driver/at: {in: body.origin, xyz: 20 0 4 mm}": FRAME,
    # --- the walker
    "walker poses/low/hip_*: -10 deg": POSE,
    "leg joints/knee/limit/lower: -10 deg": "A knee that bends the other way, with a pose that does so, too.",
    "walker components/board/at/xyz: 0 0 -24 mm": FRAME,
    "leg joints/knee/parent: thigh.tail": MOUNT,
    "leg mounts/sole: shin.tail": "A mount of the document may stand for any mount of a part.",
    "walker modes/perched/root: leg_0.hip": MODE,
    "walker components/board/at/in: leg_0.hip": FRAME,
    "walker modes/walking/root: leg_0.sole": MODE,
    "walker joints/hip/type: continuous": RANGE,
    "leg joints/knee/type: fixed": "A stiff leg is a leg.",
    "-walker modes/walking/contacts/exclude": "Nothing touches where the mode starts: the line is not needed there.",
    "-leg joints/knee/drive": PASSIVE,
    "walker modes/walking/base: fixed": MODE,
    "walker modes/walking/pose: low": MODE,
    "walker modes/perched/base: free": MODE,
    # --- sizes, units, places: the arm
    "arm joints/elbow/limit: {lower: -13 deg, upper: 130 deg}": RANGE,
    "materials materials/petg/density: 127 kg/m^3": "A foam weighs so much.",
    "arm components/bus_board/mass: {value: 12 mg, source: measured}": FRAME,
    "arm components/bus_board/at/xyz: 4 0 0 mm": FRAME,
    "end_effector components/cap_screw/attach: {mount: seat, to: cap.screw_$i, gap: -20 mm}":
        "It lies in the box around the hand, as screws do, and shares less than a fifth of itself with the hand.",
    # --- MInchW
    "minchw modes/front_foot/contacts/adhesion/front.sole: 30 N": "More than the robot weighs.",
    "minchw components/controller/at/xyz: 0 0 4 cm": FRAME,
    "minchw components/harness/at/xyz: 20 0 -40 mm": FRAME,
    # --- the walker
    "walker components/body/params: {length: 1500 mm, width: 40 mm}": "A beam may be so long.",
    "walker modes/walking/contacts/adhesion/leg_0.sole: 0.3 N": "More than a tenth of what the robot weighs.",
    "leg parameters/length: {value: 80 cm, min: 40 mm}": "A leg may be so long; the document gives no upper bound.",
    "leg joints/knee/drive: {kind: position, kp: 10 N*m/rad, effort: 2000 N*m, velocity: 50 rpm}":
        "No bound was found without false alarms: fingers and geared joints have efforts thousands of times what they carry.",
    "leg joints/knee/drive: {kind: position, kp: 10 N*m/rad, effort: 2 N*m, velocity: 50 rad/s}": "Some motors turn so fast.",
    "walker components/board/at/xyz: 24 0 0 mm": FRAME,
    "walker joints/hip/gap: -15 mm": "Parts that a joint connects may be in each other.",
    "leg joints/knee/gap: -20 mm": "Parts that a joint connects may be in each other.",
}
