"""Explain why thingc reports nothing for some of the user mistakes (slips). Either the text may be intended, or the document does not show
that it is wrong.
"""

from __future__ import annotations

POSE = "The pose is within the limits and has no contacts. Only the author can see that another pose was intended."
FRAME = (
    "The component is inside the robot, and has no shape. The document contains no other information about its position or mass."
)
RANGE = "The changed range is also valid."
MODE = "The changed mode is also valid."
PASSIVE = "Robots can have passive joints, which are joints without a drive."
MOUNT = "A component can be attached to any mount of a part, and all components are still connected."
ZERO = "The author chooses the zero position of a joint, and the poses stay within the limits."
FLOOR = "The mode specifies neither `at` nor feet, so nothing shows where the floor is."
HELD = "The base is held, so the robot does not have to be above the floor."

REASONS: dict[str, str] = {
    # --- intended values: the arm
    "arm poses/home/wrist: 30 deg": POSE,
    "arm poses/writing/wrist: 58.8 deg": HELD,
    "arm components/bus_board/at/xyz: 0 0 -4 mm": FRAME,
    "arm modes/bench/root: bracket": FLOOR,
    "arm modes/drawing/root: hand.seat": HELD,
    "arm joints/wrist/type: continuous": RANGE,
    "-arm joints/shoulder/turn": ZERO,
    "-arm components/forearm_idler": "The robot is also valid without this part.",
    "-arm modes/adrift/at": FLOOR,
    "arm modes/drawing/pose: folded": HELD,
    "arm components/plate_screw/repeat: {count: 4, as: i}": "A screw hole can stay empty.",
    "arm components/bus_board/at: {in: plate.origin, xyz: 4 0 0 mm}": FRAME,
    "arm simulation/integrator: euler": "The drives are also stable with the changed integrator.",
    "arm defaults/component/collision: hull": "Convex hulls are also valid collision shapes.",
    # --- MInchW
    "minchw poses/step_front/rear.knee: -56 deg": POSE,
    "minchw poses/step_rear/front.ankle: -45 deg":
        "The pose is within the limits, and no mode starts in this pose. A test of the document checks the pose for collisions.",
    "minchw components/harness/at/xyz: -40 0 -20 mm": FRAME,
    "minchw modes/crawl_ceiling/gravity: 0 0 -9.81 m/s^2":
        "The gravity is valid. Only the name of the mode, `ceiling`, suggests that another gravity was intended.",
    "minchw modes/crawl/root: cover": FLOOR,
    "leg joints/yaw/type: continuous": RANGE,
    "-minchw modes/crawl/pose": FLOOR,
    "-minchw modes/rear_foot/at": MODE,
    "minchw modes/crawl/base: fixed": MODE,
    "minchw modes/front_foot/pose: step_rear": MODE,
    "minchw components/magnet_driver/at: {in: body.origin, xyz: 20 0 4 mm}": FRAME,
    # --- the walker
    "walker poses/low/hip_*: -10 deg": POSE,
    "leg joints/knee/limit/lower: -10 deg": "Both the limits and the pose were changed, so the robot is consistent.",
    "walker components/board/at/xyz: 0 0 -24 mm": FRAME,
    "leg joints/knee/parent: thigh.tail": MOUNT,
    "leg mounts/sole: shin.tail": "A document can export any mount of a part.",
    "walker modes/perched/root: leg_0.hip": MODE,
    "walker components/board/at/in: leg_0.hip": FRAME,
    "walker modes/walking/root: leg_0.sole": MODE,
    "walker joints/hip/type: continuous": RANGE,
    "leg joints/knee/type: fixed": "A leg with a stiff knee is also valid.",
    "-walker modes/walking/contacts/exclude": "There are no contacts in the start pose that the deleted line would exclude.",
    "-leg joints/knee/drive": PASSIVE,
    "walker modes/walking/base: fixed": MODE,
    "walker modes/walking/pose: low": MODE,
    "walker modes/perched/base: free": MODE,
    # --- sizes, units, places: the arm
    "arm joints/elbow/limit: {lower: -13 deg, upper: 130 deg}": RANGE,
    "materials materials/petg/density: 127 kg/m^3": "A foam material can have this density.",
    "arm components/bus_board/mass: {value: 12 mg, source: measured}": FRAME,
    "arm joints/shoulder/turn: 90 rad": ZERO,
    "arm components/bus_board/at/xyz: 4 0 0 mm": FRAME,
    "arm components/elbow_servo/attach: {mount: bottom, to: humerus.servo_seat, gap: 100 mm}": "Parts can be attached with a gap.",
    # --- MInchW
    "minchw modes/front_foot/contacts/adhesion/front.sole: 30 N": "The magnet force is still larger than the weight of the robot.",
    "minchw components/controller/at/xyz: 0 0 4 cm": FRAME,
    "minchw modes/bridge/hold/rear.sole/xyz/2: -8 mm": HELD,
    "minchw modes/front_foot/at: {rpy: 0 90 0 deg}": HELD,
    "minchw components/harness/at/xyz: 20 0 -40 mm": FRAME,
    # --- the walker
    "walker components/body/params: {length: 1500 mm, width: 40 mm}": "A beam can have this length.",
    "walker modes/walking/contacts/adhesion/leg_0.sole: 0.3 N": "The magnet force is still more than a tenth of the weight of the robot.",
    "leg parameters/length: {value: 80 cm, min: 40 mm}": "A leg can have this length, and the document does not set an upper bound.",
    "leg joints/knee/drive: {kind: position, kp: 10 N*m/rad, effort: 2000 N*m, velocity: 50 rpm}":
        "A check would cause false alarms, because the effort of fingers and geared joints can be thousands of times their load.",
    "leg joints/knee/drive: {kind: position, kp: 10 N*m/rad, effort: 2 N*m, velocity: 50 rad/s}": "Some motors reach this speed.",
    "walker components/board/at/xyz: 24 0 0 mm": FRAME,
}
