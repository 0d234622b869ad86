"""Diagnostics: a closed set of codes, with the place, the expected value and a help.

Passes never raise for bad input: they add to a `Report`, so that one run reports all errors.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field
from enum import Enum

from msgspec.structs import force_setattr, replace

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.one_line_repr import OneLineRepr
from thingc.base.safe_text import shortened
from thingc.base.source import Edit, Node, Origin, Span, stands_in
from thingc.base.suggestions import Suggestion


class Severity(str, Enum):
    """Severity of a diagnostic. Only errors stop a build (warnings do with `--strict`)."""

    ERROR = "error"
    WARNING = "warning"
    NOTE = "note"


class Stage(str, Enum):
    """The command that reports all warnings of a code if it succeeds."""

    CHECK = "check"
    BUILD = "build"
    COMPAT = "build --compat"
    DENY = "build --deny-loss"
    TEST = "test"


class Code(Enum):
    """All diagnostic codes: `NAME = ("code", "title", "cure")`. Codes are never reused or renumbered.

    A code that may be a warning about an assembly document has a fourth value, the command that reports it. Such warnings can be suppressed
    where they occur (`allow: {TC407: reason}`), and so can export losses.
    TC1xx reading, TC2xx one document, TC3xx names and values across documents, TC4xx parts, TC5xx the assembly,
    TC6xx modes (TC65x tests), TC7xx targets, TC8xx folders and files, TC9xx variants (TC95x import).
    """

    # --- TC1xx: reading files (load) -------------------------------------------------------------------------------
    UNREADABLE = ("TC101", "a file cannot be read", "Check the name and the permissions of the file.")
    NOT_UTF8 = ("TC102", "a file is not UTF-8 text", "Save the file as UTF-8.")
    SYNTAX = ("TC103", "not well-formed YAML or TOML", "Mend the line shown; the hint says what a person usually meant.")
    DUPLICATE_KEY = ("TC104", "a key is written twice", "Remove or rename one of the two.")
    KEY_NOT_TEXT = ("TC105", "a key is no text", "Keys are names; put quotes around one that YAML reads as something else.")
    TAG = ("TC106", "a YAML tag", "Remove the tag: values have the type that they show.")
    ALIAS = ("TC107", "a YAML alias or merge key that cannot be followed", "Define the anchor first; write merged keys out.")
    TOO_LARGE = ("TC108", "a bound is exceeded", "Split the document: 10 MB, 100 levels, 10 000 nodes from aliases.")
    NOT_FINITE = ("TC109", "a number that is not finite", "Write a finite number, or leave the key out.")
    EXPRESSION_COMMA = ("TC110", "an unquoted comma cuts a value", "Put an expression in quotes, and the three values of a vector in `[]`.")
    HEADER = ("TC111", "the kind or version of a document is missing or unknown", "Begin with `thingc: assembly/1` or another kind.")
    WRONG_KIND = ("TC112", "a document of another kind is wanted here", "Name a document of the right kind.")
    MISSING_FILE = ("TC113", "a file that a document names is not there", "Paths are relative to the document that names them.")
    OUTSIDE_WORKSPACE = ("TC114", "a path leaves the workspace", "Keep every file in the folder of `thingc.toml`; use relative paths.")
    FILE_TYPE = ("TC115", "a file of an unknown type", "Documents are .yaml, .yml, .toml; parts .step, .brep, .stl, .3mf, .obj, .ply ...")
    DOCUMENT_CYCLE = ("TC116", "assemblies nest themselves", "Break the chain at one of the places shown.")
    NOT_A_MAPPING = ("TC117", "a document is empty or no mapping", "A document is a mapping that begins with `thingc:`.")
    DATE = ("TC118", "a date or time", "No key takes one; put it in quotes if it is text.")
    SEVERAL_DOCUMENTS = ("TC119", "several documents in one file", "Write one document per file.")
    WORKSPACE_FOLDER = ("TC120", "a folder of the workspace is not there", "Make the folder or correct its name.")
    FILE_NAME = ("TC121", "a file name with what nobody sees", "Rename the file: letters, digits, spaces and signs that can be seen.")
    # --- TC2xx: one document by itself (validate) ------------------------------------------------------------------
    UNKNOWN_KEY = ("TC201", "an unknown key", "Correct the spelling or remove the key.")
    MISSING_KEY = ("TC202", "a required key is missing", "Add the key.")
    WRONG_TYPE = ("TC203", "a value of the wrong type", "Write what the message says is expected.")
    UNKNOWN_CHOICE = ("TC204", "a value that is none of the choices", "Write one of the choices listed.")
    BAD_NAME = ("TC205", "a name with other characters than letters, digits and `_`", "Rename it; names begin with a letter.")
    BAD_UNIT = ("TC206", "a unit is missing or unknown", "Write the unit after the number: `120 mm`.")
    WRONG_DIMENSION = ("TC207", "a quantity of the wrong dimension", "Write a quantity of the dimension that is expected.")
    BAD_QUANTITY = ("TC208", "not a quantity", "Write a number and its unit: `120 mm`, `4.1 N*m`.")
    BAD_EXPRESSION = ("TC209", "an expression that cannot be read", "Mend the place shown: `+ - * / **`, parentheses, names, `min(a, b)`.")
    BAD_REFERENCE = ("TC210", "not a reference", "Write names with dots between them: `plate.servo_seat`.")
    BAD_COLOR = ("TC211", "not a colour", "Write a CSS name or `\"#rrggbb\"`.")
    BROKEN_RULE = ("TC212", "keys that do not go together", "Follow the rule in the message.")
    NO_VALUE = ("TC213", "a key without a value", "Write a value after the colon or remove the key.")
    WRONG_LENGTH = ("TC214", "a list with the wrong number of items", "Write as many items as the message says.")
    # --- TC3xx: names and values across documents (resolve) --------------------------------------------------------
    UNKNOWN_COMPONENT = ("TC302", "unknown component", "Name a component of this document, or of the assembly it goes into.")
    UNKNOWN_MOUNT = ("TC303", "unknown mount", "Name a mount that the component has, or export it in the nested document.")
    UNKNOWN_JOINT = ("TC304", "unknown joint", "Name a joint as `joint`, or `component.joint` inside a nested assembly.")
    UNKNOWN_PARAMETER = ("TC305", "unknown parameter", "Name a parameter that the part or the document declares.")
    UNKNOWN_MATERIAL = ("TC306", "unknown material", "Name a material of the documents listed under `materials`.", Stage.CHECK)
    UNKNOWN_POSE = ("TC307", "unknown pose", "Name a pose of the document.")
    UNKNOWN_MODE = ("TC308", "unknown mode", "Name a mode of the document.")
    NO_MATCH = ("TC309", "pattern without a match", "Write a pattern that fits at least one name.")
    REFERENCE = ("TC310", "not a reference", "Write `component.mount`, or `component.inner.mount` into a nested assembly.")
    NAME_CLASH = ("TC311", "two things of one name", "Rename one of them.")
    RESERVED_NAME = ("TC312", "reserved name", "`world`, `root` and `origin` have a meaning already: choose another name.")
    EXPRESSION = ("TC313", "expression cannot be evaluated", "Use the parameters of this document, with dimensions that fit.")
    DIMENSION = ("TC314", "wrong dimension", "Write a value of the dimension named in the message.")
    OUT_OF_RANGE = ("TC315", "value out of range", "Write a value within the bounds named in the message.")
    PARAMETER_CYCLE = ("TC316", "parameters in a circle", "Give one parameter of the circle a value of its own.")
    MISSING_PARAMETER = ("TC317", "missing parameter", "Give the parameter a value.")
    VALUE_KIND = ("TC318", "wrong kind of value", "Write a value of the kind named in the message.")
    PLACED_TWICE = ("TC320", "component placed twice", "Keep one of `attach`, `at` or the joint.")
    NO_BASE = ("TC321", "no base component", "One component, the base, is placed by nothing.")
    TWO_BASES = ("TC322", "more than one base component", "Give every component but one an `attach`, an `at` or a joint.")
    PLACED_ON_ITSELF = ("TC323", "component placed on itself", "Place it on another component.")
    LIMIT = ("TC324", "joint limits", "Write `limit: {lower: ..., upper: ...}` with lower < upper where the joint has limits.")
    MIMIC = ("TC325", "bad mimic", "`mimic.joint` names another moving joint of the same document, in no circle.")
    DRIVE = ("TC326", "bad drive", "A drive is a component with an actuator, or an inline one, on a joint that moves.")
    PART_MISSING = ("TC327", "no such part", "Write `module:Class` with a module on the part path and a class in it.")
    PART_REFUSED = ("TC328", "part refused", "Parts come from the workspace's `parts` folders and its allowed `packages`.")
    TOO_MANY = ("TC331", "too many", "Stay within the bounds: 10 000 per repeat, 100 000 occurrences, 100 nested documents.")
    NO_ROOT = ("TC332", "mode without a root", "Write `root: component` or `root: component.mount`.")
    EXTENDS_CYCLE = ("TC333", "modes in a circle", "Let one mode of the circle extend none.")
    POSE = ("TC334", "bad pose", "A pose sets joints that move by themselves, with values of their dimension.")
    OVERRIDE = ("TC335", "override of an assembly", "Write the override on a component of the nested document.")
    RAW_TARGET = ("TC336", "unknown target", "Raw attributes go to `mjcf`, `urdf`, `sdf` or `usd`.")
    JOINT_FIELD = ("TC338", "key that this joint has no use for", "Take the key out, or choose another joint type.")
    LIBRARY = ("TC339", "library cannot be read", "Install the library, or write the material out.")
    NO_LOCK = ("TC340", "no lock of the parts", "Run `thingc lock` where part code may run, and keep `parts.lock.json` with the documents.")
    LOCK_STALE = ("TC341", "the lock of the parts is stale", "Run `thingc lock` again, and keep what it writes.")
    LOCK_BROKEN = ("TC342", "the lock of the parts is broken", "Run `thingc lock` again; the file is not written by hand.")
    NOT_LOCKED = ("TC343", "a part is not in the lock", "Run `thingc lock` again, and keep what it writes.")
    LOCK_DOCUMENT = ("TC344", "a document could not be looked through for the lock", "Mend the document, then run `thingc lock` again.")
    NOT_LOOKED_AT = ("TC345", "geometry that was not looked at", "Run `thingc lock` again to have these parameters in the lock.")
    TOO_COSTLY = ("TC346", "a check beyond its bounds", "Make the documents smaller, or allow more with `--time-limit`.")
    HIDDEN = ("TC347", "module that hides another", "Call one of the two files otherwise.", Stage.CHECK)
    TEST = ("TC348", "test that cannot be run", "Mend the key that the message names.")
    LEAD = ("TC360", "lead of a screw", "Write `lead: 8 mm`, the advance in one turn; a left-hand thread has a negative one.")
    COORDINATES = ("TC361", "values of several coordinates", "Write a list with one entry for each coordinate of the joint.")
    MIRROR_AXES = ("TC362", "mirrored along two axes", "Mirror the assembly along the axis along which what is in it is mirrored.")
    UNKNOWN_TENDON = ("TC363", "unknown tendon", "Name a tendon of the same document.")
    TENDON_PATH = ("TC364", "path of a tendon", "Follow the rule in the message: a path goes from mount to mount.")

    # --- TC4xx: parts (realize) ------------------------------------------------------------------------------------
    PART_RAISED = ("TC401", "part raised an exception", "Give the part parameters that it can be made with, or mend the part file.")
    PART_HUNG = ("TC402", "part took too long", "Mend the part, or allow more time with `part_timeout`.")
    PART_CRASHED = ("TC403", "part crashed the interpreter", "Change what the part asks of the CAD kernel; other parts are unharmed.")
    PART_EMPTY = ("TC404", "part without volume", "Let `result()` return a solid, or None for a part without geometry.")
    PART_INVALID = ("TC405", "part is not valid", "Mend the part file at the line named.")
    PART_WARNING = ("TC406", "remark of a part", "Mend the part file at the line named.", Stage.CHECK)
    EXPECTATION = ("TC407", "not what the part was cut for", "Put the expected part there.", Stage.CHECK)
    PART_ASKS = ("TC408", "part asks more than its inputs", "Take it as a parameter, or from a file; seed generators.", Stage.CHECK)
    PART_WRITES = ("TC409", "part writes outside of its folder", "Let it write into `tempfile.gettempdir()`, or not at all.")
    PART_LEFT = ("TC410", "part leaves processes behind", "Let the part wait for what it starts.", Stage.CHECK)
    PART_SWARMED = ("TC411", "part starts too many processes", "Let it start fewer, and wait for each.")
    NOT_TWICE = ("TC412", "part that is not the same twice", "Sort what comes from a set; seed generators; take the rest as parameters.")
    NO_RESULT = ("TC413", "Thing without a result", "Write `def result(self)` that returns the geometry, or None for a part without.")
    APART = ("TC414", "solids that do not touch", "Let them overlap, or return a list where several are meant.", Stage.CHECK)
    DENSITY = ("TC415", "density of no solid", "Check the unit: solids have 10 to 25 000 kg/m^3.", Stage.CHECK)
    SIZE = ("TC416", "part of an unlikely size", "Check the unit: `unit:` of a mesh file, or that of a parameter.", Stage.CHECK)
    ROBOT_MASS = ("TC417", "robot of an unlikely mass", "Check the units of densities, masses and mesh files.", Stage.CHECK)
    UNSLICED = ("TC420", "part that cannot be cut into layers", "Mend the part, or write `estimate: skin` in its `process`.", Stage.CHECK)
    HIGH_LAYERS = ("TC421", "layers higher than lines", "Give the `process` a `layer` of at most its `line_width`.")
    PART_STARVED = ("TC424", "part needs too much memory", "Make the part simpler, or allow more with `part_memory` in `thingc.toml`.")
    PROCESS = ("TC422", "process that no printer keeps to", "Mend the number or its unit.", Stage.CHECK)
    # --- TC5xx: the assembly (link) --------------------------------------------------------------------------------
    INCOMPLETE = ("TC501", "assembly cannot be linked", "Mend what the other messages name.")
    MOUNT_CLASH = ("TC502", "two mounts of one name", "Give the mount that the document adds another name.")
    PLACEMENT_CIRCLE = ("TC503", "components in a circle", "Place one component of the circle on one outside of it.")
    NO_MATERIAL = ("TC504", "component without a mass", "Give it a `material:` with a density, or a `mass:`.")
    INFILL = ("TC505", "infill without a process", "Write `walls` and `line_width`; an `fdm` print has `layer`, `top` and `bottom`, too.")
    NOT_PHYSICAL = ("TC506", "inertia of no solid", "Moments of inertia are above 0, and none is above the sum of the other two.")
    MASSLESS = ("TC507", "moving link without mass", "Give one of its components a mass, or fuse it with another link.")
    DUPLICATE_LINK = ("TC508", "two links of one name", "Choose another name under `links:`.")
    LINK_NAMED_TWICE = ("TC509", "link with two names", "Keep one of the names under `links:`.")
    NO_ACTUATOR = ("TC510", "drive without an actuator", "Name a component whose Thing declares an actuator, or write the drive inline.")
    EFFORT = ("TC511", "effort above the actuator's", "Lower `limit.effort`, or choose a stronger actuator.", Stage.CHECK)
    NO_GAIN = ("TC512", "drive without a gain", "Give the actuator a `kp`, or a `kv` if it is driven at a velocity.")
    LOOP = ("TC513", "loop within one link", "Let a `loop: true` joint connect two links that move against each other.")
    UNNEEDED = ("TC514", "allowance that nothing needs", "Take the code out of `allow`.")
    LIMIT_TURNS = ("TC515", "limit beyond some turns", "Mend the number or its unit, or make the joint `continuous`.", Stage.CHECK)
    LIMIT_UNITS = ("TC516", "limits in two units", "Write both limits in one unit.", Stage.CHECK)
    FAR = ("TC517", "far away from the robot", "Mend the number or its unit.", Stage.CHECK)
    MAGNET = ("TC518", "magnet far too weak or too strong", "Mend the number or its unit.", Stage.CHECK)
    IDLE_ACTUATOR = ("TC519", "actuator that drives nothing", "Name the component as the `drive` of the joint that it moves.", Stage.CHECK)
    OVERLAP = ("TC520", "parts that overlap", "Remove or move one of them, or cut out the room that it needs.", Stage.BUILD)
    STUCK = ("TC521", "joint that its drive cannot move", "Mend the number or its unit, or choose a stronger drive.", Stage.CHECK)
    BARE_MASS = ("TC522", "mass without a shape, of an unlikely weight or place", "Mend the number or its unit.", Stage.CHECK)
    LONG_STEP = ("TC523", "long time step", "Write 1 to 5 ms, as is usual.", Stage.CHECK)
    GRAVITY_UP = ("TC524", "gravity that points up", "Write `gravity: floor`, or `gravity: ceiling` if it hangs from one.", Stage.CHECK)
    OTHER_MOUNT = ("TC525", "mount shown by the name of another", "Name the mount that is meant, or show it by another name.", Stage.CHECK)
    ALIKE = ("TC526", "two modes that are the same", "Write what is to be different in one of them, or take it out.", Stage.CHECK)
    MIRRORED_TURN = ("TC528", "mirrored part that is turned", "Add the `turn` that makes both sides mirror images.", Stage.CHECK)
    HELD_OFF = ("TC527", "held at a magnet that is off", "Root the mode at the magnet that is on, or let this one pull, too.", Stage.CHECK)
    NESTED_SIMULATION = ("TC532", "simulation of a nested document", "Write it in the document that nests it.", Stage.CHECK)
    MIRRORED_BOUGHT = ("TC580", "mirror image of a bought part", "Take `mirror` out, or write its order number.", Stage.CHECK)
    OWN_IMAGE = ("TC581", "part that is its own mirror image", "Take `mirror` out: the part is the same without it.", Stage.CHECK)
    # --- TC6xx: modes (root) ---------------------------------------------------------------------------------------
    POSE_LIMITS = ("TC601", "pose outside joint limits", "Write a value within the joint's limits, or widen them.")
    UNREACHED = ("TC602", "links beyond the root's reach", "Mend the placements: every link hangs together with the root.")
    HOLD = ("TC603", "hold of what stands still", "Hold mounts of links that move in the mode, each once.")
    UNCLOSED = ("TC604", "loop that does not close", "Move the hold, widen the limits of the joints, or start from another pose.")
    CUT = ("TC605", "cut of no loop", "Name joints of a loop under `cut`, one for each loop.")
    HEIGHT = ("TC606", "a height that is said twice", "Let `on: floor` say how high the robot is, or write it; not both.")
    STANDING = ("TC608", "a mode that cannot stand so", "Let a mode with a free base stand on mounts that nothing else holds, each once.")
    NOTHING_TOUCHES = ("TC607", "nothing that could touch the floor", "Give a part a `collision` shape, or write where the root is.")
    START_BELOW = ("TC610", "mode that starts under the floor", "Raise the root: `at: {xyz: ...}`, or `at: {on: floor}`.", Stage.BUILD)
    START_CONTACT = ("TC611", "links that start in each other", "Change the pose or a `collision`, or exclude the pair.", Stage.BUILD)
    CHATTER = ("TC612", "gain that chatters", "Lower the gain, state the rotor's `armature`, or take shorter steps.", Stage.BUILD)
    POSE_MOVED = ("TC618", "pose changed to close a loop", "Write values with which the loops close, or leave some out.", Stage.CHECK)
    OFF_FEET = ("TC790", "mode that does not stand on its feet", "Start in a pose that puts the feet down.", Stage.CHECK)
    START_LIMITS = ("TC791", "mode that starts outside joint limits", "Give the mode a pose within the limits.", Stage.CHECK)
    COLLISION_MISSING = ("TC704", "no such collision shape", "Choose another `collision`, or give the Thing a `collision()`.")
    STATED = ("TC792", "centre or inertia of another body", "Mend the number or its unit.", Stage.CHECK)
    # --- TC65x: tests of the document (thingc test) ----------------------------------------------------------------
    TEST_MASS = ("TC651", "mass outside its bounds", "Change what weighs too much or too little, or the bound.")
    TEST_CENTRE = ("TC652", "centre of mass outside its box", "Move what is heavy, or widen the box.")
    TEST_REACH = ("TC653", "reach outside its bounds", "Change lengths or the limits of joints, or the bound.")
    TEST_POINT = ("TC654", "point out of reach", "Move the point, change lengths or the limits of joints, or allow more distance.")
    TEST_COLLISION = ("TC655", "parts that collide", "Change a part, a pose or a range, or allow the pair with a reason.")
    TEST_TORQUE = ("TC656", "too little torque", "Choose a stronger drive, a lighter robot or another pose, or lower the margin.")
    TEST_SETTLES = ("TC657", "no rest in simulation", "Change the pose, the drives or the bounds; look at it with `thingc build`.")
    TEST_POSE = ("TC658", "pose that a test cannot take", "Name a pose in which the mode's loops close.")
    TEST_ALLOWANCE = ("TC659", "allowance that is never needed", "Take the pair out of `allow`.", Stage.TEST)
    TEST_FALLS = ("TC660", "robot that falls over", "Move its feet or what is heavy, or let it stand on more feet.")
    TEST_FOOT = ("TC661", "feet in the air", "Lower them in the pose, or let the mode stand on others.")
    TEST_CLEARANCE = ("TC662", "too near to the ground", "Change a part or a pose, or name what may touch the ground under `except`.")
    # --- TC7xx: targets (emit) -------------------------------------------------------------------------------------
    RAW_UNKNOWN = ("TC701", "raw attribute of nothing", "Name a kind of element and an element that the model has.")
    MJCF_REFUSED = ("TC702", "MuJoCo refuses the model", "Change what stands at the place named, as MuJoCo's words say.")
    MJCF_WARNING = ("TC703", "MuJoCo warns of the model", "Change what stands at the place named, as MuJoCo's words say.", Stage.BUILD)
    LOSS_DENIED = ("TC706", "a target cannot say this", "Leave it out of the document, or allow the loss where it is meant.", Stage.DENY)
    RAW_FIXED = ("TC707", "raw attribute that identifies", "Say it in the words of the document, as the hint shows.")
    TOO_LIGHT = ("TC708", "link too light for MuJoCo", "Check the units of its files, sizes and masses, or attach it to another link.")
    SAME_NAME = ("TC709", "two names that a target cannot tell apart", "Rename one of the two.")
    COMPAT = ("TC710", "model that another program refuses", "Change what stands there, or leave the mode out with --mode.", Stage.COMPAT)
    STEP_FAILED = ("TC752", "the STEP file could not be written", "Leave `step` out with --emit, or change the part that is named.")
    UNSTATED = ("TC753", "target with files that it does not state", "Tell the author of the package: `WRITES` of its module lists them.")
    SAME_FILE = ("TC751", "two definitions make one file name", "Rename one of the two part files.")
    # --- TC8xx: folders and files (driver, command line) -----------------------------------------------------------
    COMMAND_LINE = ("TC801", "wrong command line", "`thingc COMMAND --help` shows what it takes.")
    NO_DOCUMENT = ("TC802", "no such document", "Name an assembly document that is there.")
    PARAMETER_OPTION = ("TC803", "bad -p", "Write -p 'NAME=VALUE' with a parameter of the document, as the document would.")
    CHOICE_OPTION = ("TC809", "bad --set", "Write --set 'joints.NAME.limit.upper=90 deg' or --set 'components.NAME.part=module:Class'.")
    UNEXPECTED = ("TC804", "unexpected files in the build folder", "Move the named files away, or build elsewhere with -o.")
    OUTPUT = ("TC805", "cannot write", "Make room, or choose a folder that can be written with -o or --store.")
    PART_UNREADABLE = ("TC807", "a part file that does not load", "Mend the part file at the line named.")
    NO_GRAPHICS = ("TC808", "no picture can be drawn here", "Install EGL (Debian, Ubuntu: apt install libegl1), or set MUJOCO_GL.")
    WORKING_FOLDER = ("TC810", "the working folder is gone", "Go to a folder that is there, and try again.")
    INTERNAL = ("TC899", "a defect of thingc", "Report it with the document and what --debug shows.")
    # --- TC9xx: variants (batch) -----------------------------------------------------------------------------------
    VARIANT_VALUE = ("TC901", "a value that variants cannot have", "Write values, ranges and counts as the message says.")
    VARIANT_CHOICE = ("TC902", "a choice that cannot be made", "Choose a part, an assembly or a material that fits at the place named.")
    RULE = ("TC903", "a rule that cannot be decided", "Compare parameters and results of one dimension: `mass < 2.5 kg`.")
    VARIANT_TARGET = ("TC904", "an unknown target", "Name targets that `thingc build --emit` knows.")
    DUPLICATE_VARIANT = ("TC905", "a variant written twice", "Remove one of the two: a variant is built once.")
    RESULT = ("TC906", "a result that a variant has not", "Leave the result out of the rules, or let the mode and the mounts give it.")
    VARIANT_DIED = ("TC911", "a runner died", "The other variants are unharmed; build this one alone with its `command`.")
    VARIANT_HUNG = ("TC912", "a variant took too long", "Allow more time with --timeout, or build this one alone with its `command`.")
    VARIANT_RAISED = ("TC913", "a defect of thingc, met by a variant", "Report it with what the journal says of the variant.")
    BATCH_LOCKED = ("TC921", "a batch is under way in this folder", "Wait for it, or write into another folder with -o.")
    BATCH_UNFINISHED = ("TC922", "the folder holds an unfinished batch", "Go on with --resume, or delete the folder.")
    BATCH_CHANGED = ("TC923", "not the batch that was begun", "Undo the change, or begin anew in another folder with -o.")
    NO_BATCH = ("TC924", "nothing to resume", "Begin without --resume.")
    RUNNERS = ("TC925", "no runner starts", "Mend what the message names; what has been built stays, and --resume goes on.")
    CLUSTER = ("TC926", "the cluster does not answer", "Mend what the message names; what has been built stays, and --resume goes on.")

    # --- TC95x: robots of other formats (import) -------------------------------------------------------------------
    SOURCE_XML = ("TC951", "file of a robot that cannot be read", "Mend the place shown, or name a file of a format that is read.")
    SOURCE_VALUE = ("TC952", "value that a robot's file cannot have", "Mend the number or the word that the message names.")
    SOURCE_TREE = ("TC953", "links and joints that are no tree", "Let one link be the root, and each other one hang on it by one joint.")
    SOURCE_INERTIA = ("TC954", "link of a file that cannot move", "Mend its mass or inertia, or write `--repair inertia=nearest`.")
    SOURCE_DOUBT = ("TC955", "doubt about a robot's file", "Look at the two places, and mend the file if one of them is wrong.")
    SOURCE_FILE = ("TC956", "file that a robot's file names", "Specify `--package NAME=DIR` or `--mesh-root DIR`, or use `--no-meshes`.")
    SOURCE_CONFLICT = ("TC957", "change here and in the source", "Write at the place shown what is right.")

    def __init__(self, code: str, title: str, cure: str, warned_by: Stage | None = None) -> None:
        self.code = code
        self.title = title
        self.cure = cure
        self.warned_by = warned_by


class Note(OneLineRepr, FrozenStruct):
    """A second place or more information, such as "mount declared here". The message is shortened as in `Diagnostic`."""

    message: str
    span: Span | None = None

    def __post_init__(self) -> None:
        force_setattr(self, "message", shortened(self.message))


def noted(message: str, origin: Origin) -> tuple[Note, ...]:
    """Return a note at the innermost place of `origin`; empty if `origin` is empty."""
    return (Note(message=message, span=origin[0]),) if origin else ()


class Diagnostic(OneLineRepr, FrozenStruct):
    """A diagnostic.

    `path` is the key path in the document, or the path of the occurrence or joint. `detail` (such as the traceback of a part) is shown only
    with `--debug`. `fixes` are unambiguous edits for `thingc check --fix`. `message` and `help` are shortened here, for all output formats.
    """

    code: Code
    severity: Severity
    message: str
    span: Span | None = None
    path: str | None = None
    help: str | None = None
    notes: tuple[Note, ...] = ()
    detail: str | None = None
    fixes: tuple[Edit, ...] = ()

    def __post_init__(self) -> None:
        force_setattr(self, "message", shortened(self.message))
        if self.help is not None:
            force_setattr(self, "help", shortened(self.help))


class Allowance(FrozenStruct, eq=False):
    """A line of `allow:`, which suppresses warnings of `code` that show a place in one of `nodes`.

    `nodes` are the mapping that contains the line and, for a mode, those that are merged over it, each with the span of its key. `where` is
    the place of the line, `path` that of its mapping in the document.
    """

    code: Code
    reason: str
    where: Span
    path: str
    nodes: tuple[tuple[Span, Node], ...]

    def covers(self, code: Code, places: Collection[Span]) -> bool:
        """Return whether this suppresses a warning of `code`: one of `places` is in the mapping."""
        return code is self.code and any(key.holds(place) or stands_in(node, place) for key, node in self.nodes for place in places)


def allow_hint(code: Code) -> str:
    """Return a hint on how to suppress a warning."""
    return f'if that is meant so, write `allow: {{{code.code}: "the reason"}}`'


@dataclass(slots=True)
class Report:
    """Collects the diagnostics of all passes; the only mutable object that passes share.

    Warnings that one of the `allowances` covers are suppressed: `needed` are the allowances that were used, `allowed` is the number of
    suppressed warnings.
    """

    diagnostics: list[Diagnostic] = field(default_factory=list)
    allowances: Sequence[Allowance] = ()
    needed: set[Allowance] = field(default_factory=set)
    allowed: int = 0
    _known: set[Diagnostic] = field(default_factory=set, repr=False)

    def add(
        self, code: Code, message: str, where: Span | Origin | None, *, help: str | None = None, path: str | None = None,
        notes: Iterable[Note] = (), severity: Severity = Severity.ERROR, detail: str | None = None,
    ) -> bool:
        """Add a diagnostic. The place is `where`, or the innermost span of an `Origin`, whose other spans become notes.

        An unambiguous `Suggestion` as message or help adds a fix. Return False if the warning is suppressed.
        """
        span: Span | None
        extra: list[Note] = list(notes)
        if where is None or isinstance(where, Span):
            span = where
        else:
            span = where[0] if where else None
            extra.extend(Note(message="nested from here", span=outer) for outer in where[1:])
        diagnostic = Diagnostic(
            code=code, severity=severity, message=message, span=span, path=path, help=help, notes=tuple(extra),
            detail=detail, fixes=_fixes(span, message, help),
        )
        return self.say(diagnostic)

    def say(self, diagnostic: Diagnostic) -> bool:
        """Add a diagnostic unless it is a duplicate. Return False if it is suppressed."""
        diagnostic = _of_option(diagnostic)
        places = [place for place in (diagnostic.span, *(note.span for note in diagnostic.notes)) if place is not None]
        if diagnostic.severity is Severity.WARNING and self.allows(diagnostic.code, places):
            return False
        if diagnostic not in self._known:
            self._known.add(diagnostic)
            self.diagnostics.append(diagnostic)
        return True

    def allows(self, code: Code, places: Collection[Span]) -> bool:
        """Return whether a warning that shows these places is suppressed; if so, mark the allowances as needed."""
        covering = [allowance for allowance in self.allowances if allowance.covers(code, places)]
        self.needed.update(covering)
        self.allowed += bool(covering)
        return bool(covering)

    def warn(
        self, code: Code, message: str, where: Span | Origin | None, *, help: str | None = None, path: str | None = None,
        notes: Iterable[Note] = (),
    ) -> bool:
        """Add a warning (see `add`)."""
        return self.add(code, message, where, help=help, path=path, notes=notes, severity=Severity.WARNING)

    def continued(self) -> Report:
        """Return a copy of this report, to continue separately."""
        return Report(list(self.diagnostics), self.allowances, set(self.needed), self.allowed, set(self._known))

    def say_unneeded(self, document: str, stages: Collection[Stage]) -> None:
        """Warn of each unnecessary allowance in `document` (an absolute path).

        An allowance is unnecessary if it suppressed nothing, and one of the completed `stages` reports its code. Those of nested documents
        are skipped: other robots may need them.
        """
        for allowance in self.allowances:
            if allowance.where.file == document and allowance.code.warned_by in stages and allowance not in self.needed:
                where = f"`{allowance.path}`" if allowance.path else "the document"
                self.warn(
                    Code.UNNEEDED, f"{where} allows `{allowance.code.code}` ({allowance.code.title}), and nothing there needs it",
                    allowance.where, path=f"{allowance.path}.allow".lstrip("."),
                    help="remove it from `allow`, unless a document that nests this one needs it",
                    notes=[Note(message=f"the reason given is: {allowance.reason}")],
                )

    @property
    def failed(self) -> bool:
        """Return whether there is an error."""
        return any(d.severity is Severity.ERROR for d in self.diagnostics)

    def ordered(self) -> list[Diagnostic]:
        """Return the diagnostics by file, line and column (those without a place last), else in the order of reporting."""
        return sorted(
            self.diagnostics,
            key=lambda d: (d.span is None, d.span.file if d.span else "", *((d.span.line, d.span.column) if d.span else (0, 0))),
        )

    def judged(self, *, strict: bool) -> Report:
        """Return this report; with `strict`, a copy in which warnings are errors."""
        return self if not strict else Report([
            replace(d, severity=Severity.ERROR) if d.severity is Severity.WARNING else d for d in self.diagnostics
        ])


def _of_option(diagnostic: Diagnostic) -> Diagnostic:
    """Replace places in values of `--set` by the option, since there is no file to show."""
    notes = tuple(
        Note(message=f"{note.message}: `{note.span.option}`") if note.span is not None and note.span.option is not None else note
        for note in diagnostic.notes
    )
    option = diagnostic.span.option if diagnostic.span is not None else None
    if option is None:
        return replace(diagnostic, notes=notes) if notes != diagnostic.notes else diagnostic
    code = Code.CHOICE_OPTION if diagnostic.severity is Severity.ERROR else diagnostic.code
    return replace(diagnostic, code=code, span=None, path=option, notes=notes, fixes=())


MAX_FAULTS = 200
"""Maximum number of faults reported per document or pass."""


def _fixes(span: Span | None, *words: str | None) -> tuple[Edit, ...]:
    mends = next((hint.mends for hint in words if isinstance(hint, Suggestion) and hint.mends is not None), None)
    return (Edit(span=span, written=mends[0], replacement=mends[1]),) if mends is not None and span is not None else ()


def shown_path(file: str) -> str:
    """Return the display path of a file: relative to the working folder if it is near, else unchanged."""
    try:
        relative = os.path.relpath(file)
    except (OSError, ValueError):  # the working folder was deleted, or the file name is invalid
        return file
    return file if relative.startswith(os.path.join("..", "..", "..")) else relative
