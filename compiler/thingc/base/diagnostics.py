"""Diagnostics, each with a code, a location, a message and a help text.

Passes never raise exceptions for bad input. Instead, passes add diagnostics to a `Report`, so that one run reports all errors.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field
from enum import Enum

from msgspec.structs import force_setattr, replace

from thingc.base.exceptions import PicklableError
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.one_line_repr import OneLineStruct, format_count
from thingc.base.safe_text import abbreviate
from thingc.base.source import Edit, Node, Origin, Span, stands_in
from thingc.base.suggestions import Hint, Suggestion, text_of


class Severity(str, Enum):
    """The severity of a diagnostic. By default, only errors stop a build. With `--strict`, warnings also stop a build."""

    ERROR = "error"
    WARNING = "warning"
    NOTE = "note"


class Stage(str, Enum):
    """A command that can report warnings. Each diagnostic code that can be a warning belongs to one command."""

    CHECK = "check"
    BUILD = "build"
    COMPAT = "build --compat"
    DENY = "build --deny-loss"
    TEST = "test"


class Code(Enum):
    """All diagnostic codes of thingc, such as `TC407`, each with its title and a general hint on how to fix the problem.

    TC1xx concern the reading of files, TC2xx a single document, and TC3xx names and values across documents. TC4xx concern parts, TC5xx the
    assembly, TC6xx modes, TC7xx targets, TC8xx folders and files, and TC9xx variants. TC65x concern document tests, and TC95x the import of
    other formats.

    Codes are never reused or renumbered. The value of a member is `(code, title, fix)`. For a code that can be a warning about an assembly
    document, the fourth value is the command that reports the warning. Documents can suppress these warnings, and export losses, by an
    entry such as `allow: {TC407: reason}`. The command `python docs/generate.py` writes the members from the pages in `docs/codes/`.
    """

    def __init__(self, code: str, title: str, cure: str, warned_by: Stage | None = None) -> None:
        self.code = code
        self.title = title
        self.cure = cure
        self.warned_by = warned_by

    # --- TC1xx: reading files (load) -------------------------------------------------------------------------------
    UNREADABLE = ("TC101", "a file cannot be read", "Check the name and the permissions of the file.")
    NOT_UTF8 = ("TC102", "a file is not UTF-8 text", "Save the file as UTF-8.")
    SYNTAX = ("TC103", "a YAML or TOML syntax error", "Correct the syntax of the line that the message shows.")
    DUPLICATE_KEY = ("TC104", "a key that occurs twice", "Remove or rename one of the two keys.")
    KEY_NOT_TEXT = ("TC105", "a key that is not a string", "Put the key in quotes.")
    TAG = ("TC106", "an unsupported YAML tag", "Remove the tag.")
    ALIAS = (
        "TC107", "an undefined YAML alias or a merge key",
        "Define the anchor before the alias, or copy the merged keys into the mapping.",
    )
    TOO_LARGE = ("TC108", "a size limit is exceeded", "Split the document into several documents, or use fewer aliases.")
    NOT_FINITE = ("TC109", "a number that is not finite", "Write a finite number, or remove the key.")
    EXPRESSION_COMMA = ("TC110", "an unquoted comma in a value", "Put an expression in quotes, and write a vector as `[x, y, z]`.")
    HEADER = ("TC111", "the kind or version of a document is missing or unknown", "Begin the document with `thingc: assembly/1`.")
    WRONG_KIND = ("TC112", "a document of the wrong kind", "Use a document of the kind that the message shows.")
    MISSING_FILE = ("TC113", "a missing file", "Correct the path, relative to the folder of the document.")
    OUTSIDE_WORKSPACE = ("TC114", "a path outside the workspace", "Move the file into the workspace, and use a relative path.")
    FILE_TYPE = ("TC115", "a file of an unknown type", "Use .yaml, .yml or .toml for documents, and a CAD format for parts.")
    DOCUMENT_CYCLE = ("TC116", "an assembly contains itself", "Remove one of the components that form the cycle.")
    NOT_A_MAPPING = ("TC117", "a document is empty or not a mapping", "Write a mapping with `thingc:` as its first key.")
    DATE = ("TC118", "a date or time as a value", "Put the value in quotes.")
    SEVERAL_DOCUMENTS = ("TC119", "several documents in one file", "Write one document per file.")
    WORKSPACE_FOLDER = ("TC120", "a missing folder of the workspace", "Create the folder, or correct its name in `thingc.toml`.")
    FILE_NAME = ("TC121", "a file name with invisible characters", "Remove the invisible characters from the file name.")
    # --- TC2xx: one document by itself (validate) ------------------------------------------------------------------
    UNKNOWN_KEY = ("TC201", "an unknown key", "Correct the spelling or remove the key.")
    MISSING_KEY = ("TC202", "a required key is missing", "Add the required key that the message shows.")
    WRONG_TYPE = ("TC203", "a value of the wrong type", "Write the type of value that the message shows.")
    UNKNOWN_CHOICE = ("TC204", "a value that is not one of the choices", "Write one of the choices that the message lists.")
    BAD_NAME = ("TC205", "a name with invalid characters", "Write a name of letters, digits and `_` that begins with a letter.")
    BAD_UNIT = ("TC206", "a unit is missing or unknown", "Write the unit after the number: `120 mm`.")
    WRONG_DIMENSION = ("TC207", "a quantity of the wrong physical dimension", "Use a unit of the dimension that the message shows.")
    BAD_QUANTITY = ("TC208", "a value that is not a quantity", "Write a number and its unit: `120 mm`, `4.1 N*m`.")
    BAD_EXPRESSION = (
        "TC209", "an expression that cannot be parsed",
        "Use numbers, names, `+ - * / **`, `()` and functions such as `min(a, b)`.",
    )
    BAD_REFERENCE = ("TC210", "a value that is not a reference", "Separate names with dots: `plate.servo_seat`.")
    BAD_COLOR = ("TC211", "a value that is not a colour", "Write a CSS colour name or `\"#rrggbb\"`.")
    BROKEN_RULE = ("TC212", "keys that cannot be combined", "Add or remove keys as the message describes.")
    NO_VALUE = ("TC213", "a key without a value", "Write a value after the colon or remove the key.")
    WRONG_LENGTH = ("TC214", "a list with the wrong number of items", "Write the number of items that the message requires.")
    # --- TC3xx: names and values across documents (resolve) --------------------------------------------------------
    UNKNOWN_COMPONENT = ("TC302", "unknown component", "Use a component that the document defines.")
    UNKNOWN_MOUNT = ("TC303", "unknown mount", "Use a mount of the component, or export the mount in the nested document.")
    UNKNOWN_JOINT = ("TC304", "unknown joint", "Write the name of a joint, or `component.joint` for a joint of a nested assembly.")
    UNKNOWN_PARAMETER = ("TC305", "unknown parameter", "Use a parameter that the part or the document declares.")
    UNKNOWN_MATERIAL = ("TC306", "unknown material", "Use a material that the document or one of its `materials` defines.", Stage.CHECK)
    UNKNOWN_POSE = ("TC307", "unknown pose", "Use a pose that the document defines.")
    UNKNOWN_MODE = ("TC308", "unknown mode", "Use a mode that the document defines.")
    NO_MATCH = ("TC309", "pattern that matches no name", "Write a pattern that matches at least one name.")
    REFERENCE = ("TC310", "reference to an element of the wrong kind", "Write `component.mount`, or `assembly.component.mount`.")
    NAME_CLASH = ("TC311", "name used twice", "Rename one of the two elements.")
    RESERVED_NAME = ("TC312", "reserved name", "Choose a name other than `world`, `root` and `origin`.")
    EXPRESSION = ("TC313", "expression cannot be evaluated", "Use parameters of the document, and add only values of the same dimension.")
    DIMENSION = ("TC314", "wrong physical dimension", "Write a value of the physical dimension that the message shows.")
    OUT_OF_RANGE = ("TC315", "value out of range", "Write a value within the bounds that the message shows.")
    PARAMETER_CYCLE = ("TC316", "parameters in a cycle", "Set one parameter of the cycle to a value that does not use other parameters.")
    MISSING_PARAMETER = ("TC317", "missing parameter", "Set the parameter under `params` of the component.")
    VALUE_KIND = ("TC318", "wrong type of value", "Write a value of the type that the message shows.")
    PLACED_TWICE = ("TC320", "component placed twice", "Place the component with only one of `attach`, `at` and a joint.")
    NO_BASE = ("TC321", "no base component", "Remove the `attach`, `at` or joint of the base component.")
    TWO_BASES = ("TC322", "more than one base component", "Add `attach`, `at` or a joint to every component except the base.")
    PLACED_ON_ITSELF = ("TC323", "component placed on itself", "Place the component on another component.")
    LIMIT = ("TC324", "invalid joint limits", "Write `limit: {lower: ..., upper: ...}` with lower < upper, or use `continuous`.")
    MIMIC = ("TC325", "invalid `mimic` of a joint", "Set `mimic.joint` to another moving joint of the same document.")
    DRIVE = ("TC326", "invalid drive of a joint", "Use a component with an actuator, or write the drive inline.")
    PART_MISSING = ("TC327", "unknown part", "Write `module:Class` with a module in a part folder and a class of this module.")
    PART_REFUSED = ("TC328", "part of a module that is not allowed", "Use a part from the `parts` folders or `packages` in `thingc.toml`.")
    TOO_MANY = ("TC331", "there are too many elements", "Reduce the number that the message shows.")
    NO_ROOT = ("TC332", "mode without a root", "Write `root: component` or `root: component.mount`.")
    EXTENDS_CYCLE = ("TC333", "modes that extend each other in a cycle", "Remove `extends` from one mode of the cycle.")
    POSE = ("TC334", "invalid value in a pose", "Set only joints that move independently.")
    OVERRIDE = ("TC335", "key that a nested assembly does not support", "Move the key to a component of the nested document.")
    RAW_TARGET = ("TC336", "unknown target", "Use `mjcf`, `urdf`, `sdf` or `usd` under `raw`.")
    JOINT_FIELD = ("TC338", "key that this joint does not support", "Remove the key, or choose another joint type.")
    LIBRARY = ("TC339", "library cannot be read", "Install the library, or define the material without `base`.")
    NO_LOCK = ("TC340", "missing `parts.lock.json`", "Run `thingc lock`, and commit `parts.lock.json`.")
    LOCK_STALE = ("TC341", "the lock file is out of date", "Run `thingc lock` again, and commit `parts.lock.json`.")
    LOCK_BROKEN = ("TC342", "the lock file is damaged", "Run `thingc lock` again.")
    NOT_LOCKED = ("TC343", "a part is not in the lock file", "Run `thingc lock` again, and commit `parts.lock.json`.")
    LOCK_DOCUMENT = ("TC344", "a document with errors cannot be locked", "Fix the document, then run `thingc lock` again.")
    NOT_LOOKED_AT = ("TC345", "geometry that was not checked", "Run `thingc lock` again to add these parameters to the lock file.")
    TOO_COSTLY = ("TC346", "check that exceeds its time or memory limit", "Make the documents smaller, or increase `--time-limit`.")
    HIDDEN = ("TC347", "module that hides a module with the same name", "Rename one of the two files.", Stage.CHECK)
    TEST = ("TC348", "test that cannot be run", "Correct the key that the message shows.")
    CONTACTS = ("TC349", "invalid contact pair or contact group", "Correct the entry of `contacts` as the message describes.")
    LEAD = ("TC360", "invalid screw lead", "Write the advance per turn, such as `lead: 8 mm`.")
    COORDINATES = ("TC361", "wrong number of coordinates", "Write a list with one value for each coordinate of the joint.")
    MIRROR_AXES = ("TC362", "component mirrored along two axes", "Use the same mirror axis for the assembly and the component inside it.")
    UNKNOWN_TENDON = ("TC363", "unknown tendon", "Use a tendon of the same document.")
    TENDON_PATH = ("TC364", "invalid path of a tendon", "Correct the path as the message describes.")
    MOTION = ("TC368", "invalid motion", "Correct the poses, the times or the CSV file as the message describes.")
    TRANSMISSION = ("TC365", "invalid transmission", "Correct the ratio or matrix, or use each actuator and joint only once.", Stage.CHECK)

    # --- TC4xx: parts (realize) ------------------------------------------------------------------------------------
    PART_RAISED = ("TC401", "part raised an exception", "Change the parameters of the component, or fix the part file.")
    PART_HUNG = ("TC402", "part took too long", "Make the part faster, or increase the time limit with `part_timeout`.")
    PART_CRASHED = ("TC403", "part crashed the interpreter", "Change the calls to the CAD kernel in the part file.")
    PART_EMPTY = ("TC404", "part without volume", "Return a solid from `result()`, or None for a part without geometry.")
    PART_INVALID = ("TC405", "part is not valid", "Fix the part file at the line that the message shows.")
    PART_WARNING = ("TC406", "Python warning from a part", "Fix the part file at the line that the message shows.", Stage.CHECK)
    EXPECTATION = ("TC407", "unexpected part on a mount", "Attach the expected part.", Stage.CHECK)
    PART_ASKS = ("TC408", "part with undeclared inputs", "Use a parameter or a file instead, and seed random generators.", Stage.CHECK)
    PART_WRITES = ("TC409", "part writes outside its folder", "Write files only to `tempfile.gettempdir()`.")
    PART_LEFT = ("TC410", "part leaves processes running", "Wait for every process that the part starts.", Stage.CHECK)
    PART_SWARMED = ("TC411", "part starts too many processes", "Start fewer processes, and wait for each process.")
    NOT_TWICE = ("TC412", "part that is not reproducible", "Sort sets, seed random generators, and replace other inputs by parameters.")
    NO_RESULT = ("TC413", "part class without `result()`", "Define `result(self)`.")
    APART = ("TC414", "solids that do not touch", "Make the solids overlap, or return a list of solids.", Stage.CHECK)
    DENSITY = ("TC415", "implausible density", "Check the unit: the density of solids is 10 to 25 000 kg/m^3.", Stage.CHECK)
    SIZE = ("TC416", "part of implausible size", "Check the unit: `unit:` of a mesh file, or the unit of a parameter.", Stage.CHECK)
    ROBOT_MASS = ("TC417", "robot of implausible mass", "Check the units of densities, masses and mesh files.", Stage.CHECK)
    UNSLICED = ("TC420", "part that cannot be sliced", "Fix the part, or write `estimate: skin` in its `process`.", Stage.CHECK)
    HIGH_LAYERS = ("TC421", "layer height above the line width", "Reduce `layer` or increase `line_width` in the `process`.")
    PART_STARVED = ("TC424", "part needs too much memory", "Make the part simpler, or increase `part_memory` in `thingc.toml`.")
    INTERFACE_GEOMETRY = ("TC425", "interface that does not match the part", "Correct the `interface`, or the part.", Stage.CHECK)
    PROCESS = ("TC422", "implausible printing process", "Correct the number or its unit.", Stage.CHECK)
    # --- TC5xx: the assembly (link) --------------------------------------------------------------------------------
    INCOMPLETE = ("TC501", "assembly cannot be linked", "Fix the other errors that thingc reports.")
    MOUNT_CLASH = ("TC502", "mount that the part already has", "Rename the mount that the document adds.")
    PLACEMENT_CIRCLE = ("TC503", "components placed in a cycle", "Place one component of the cycle on a component outside the cycle.")
    NO_MATERIAL = ("TC504", "component without a mass", "Add a `material:` with a density, or a `mass:`, to the component.")
    INFILL = ("TC505", "print process with missing keys", "Add `walls` and `line_width`, and for `fdm` also `layer`, `top` and `bottom`.")
    NOT_PHYSICAL = ("TC506", "physically impossible inertia", "Correct the moments of inertia or their unit.")
    MASSLESS = ("TC507", "moving link without mass", "Add a mass to a component of the link, or use `attach` instead of the joint.")
    DUPLICATE_LINK = ("TC508", "two links with the same name", "Choose another name under `links:`.")
    LINK_NAMED_TWICE = ("TC509", "link with two names", "Remove one of the two names from `links:`.")
    NO_ACTUATOR = ("TC510", "drive without an actuator", "Use a component whose part declares an actuator, or write the drive inline.")
    EFFORT = ("TC511", "effort limit above the actuator's maximum", "Reduce `limit.effort`, or use a stronger actuator.", Stage.CHECK)
    NO_GAIN = ("TC512", "drive without a gain", "Add `kp` to a position drive, or `kv` to a velocity drive.")
    LOOP = ("TC513", "loop within one link", "Connect two links that can move relative to each other.")
    UNNEEDED = ("TC514", "unused entry of `allow`", "Remove the entry from `allow`.")
    LIMIT_TURNS = ("TC515", "limit of more than two turns", "Correct the number or its unit, or make the joint `continuous`.", Stage.CHECK)
    LIMIT_UNITS = ("TC516", "limits in two units", "Write both limits in the same unit.", Stage.CHECK)
    FAR = ("TC517", "implausible distance", "Correct the number or its unit.", Stage.CHECK)
    MAGNET = ("TC518", "implausible adhesion", "Correct the number or its unit.", Stage.CHECK)
    IDLE_ACTUATOR = ("TC519", "actuator that does not drive a joint", "Add `drive` with the name of the component to a joint.", Stage.CHECK)
    OVERLAP = ("TC520", "parts that overlap", "Remove or move one of the parts, or add a cutout to the other part.", Stage.BUILD)
    STUCK = ("TC521", "joint that its drive cannot move", "Correct the number or its unit, or choose a stronger drive.", Stage.CHECK)
    BARE_MASS = ("TC522", "implausible mass of a component without a shape", "Correct the number or its unit.", Stage.CHECK)
    LONG_STEP = ("TC523", "long time step", "Write a time step of 1 to 5 ms.", Stage.CHECK)
    GRAVITY_UP = (
        "TC524", "gravity that points up",
        "Write `gravity: floor`, or `gravity: ceiling` for a robot that hangs from a ceiling.", Stage.CHECK,
    )
    OTHER_MOUNT = (
        "TC525", "exported mount with the name of another mount",
        "Export the other mount, or rename the exported mount.", Stage.CHECK,
    )
    ALIKE = ("TC526", "two equal modes", "Change or remove one of the two modes.", Stage.CHECK)
    MIRRORED_TURN = ("TC528", "mirrored part with a wrong rotation", "Correct the `turn` of the mirrored part.", Stage.CHECK)
    HELD_OFF = ("TC527", "base held at an inactive magnet", "Use the mount of the active magnet as the root.", Stage.CHECK)
    NESTED_SIMULATION = ("TC532", "unused settings of a nested document", "Copy the settings into the enclosing document.", Stage.CHECK)
    SHAPE_FAR = ("TC533", "collision shape far outside its part", "Correct the unit, the size or the pose of the shape.", Stage.CHECK)
    INTERFACE = ("TC534", "mounts that do not fit together", "Use mounts that fit together, or correct the `interface` of one mount.")
    SCREW = ("TC535", "screw of the wrong length", "Use a screw of another length, or correct the `depth` of the hole.", Stage.CHECK)
    MIRRORED_BOUGHT = (
        "TC580", "mirror image of a bought part",
        "Remove `mirror`, or add the order number of the mirror image.", Stage.CHECK,
    )
    OWN_IMAGE = ("TC581", "part that is its own mirror image", "Remove `mirror`.", Stage.CHECK)
    # --- TC6xx: modes (root) ---------------------------------------------------------------------------------------
    POSE_LIMITS = ("TC601", "pose outside joint limits", "Write a value within the limits of the joint, or widen the limits.")
    UNREACHED = ("TC602", "links not connected to the root", "Correct the placements, so that every link is connected to the root.")
    HOLD = ("TC603", "held mount on a link that does not move", "Remove mounts of links that do not move in the mode.")
    UNCLOSED = ("TC604", "loop that does not close", "Move the mount in `hold`, widen joint limits, or change the start pose.")
    CUT = ("TC605", "cut at a joint that is not in a loop", "List one joint of each loop under `cut`.")
    HEIGHT = ("TC606", "height specified twice", "Use `on: floor`, or write the height, but not both.")
    STANDING = ("TC608", "mode with invalid `standing_on`", "Use `base: free`. List each foot only once, and remove feet from `hold`.")
    NOTHING_TOUCHES = ("TC607", "no shape can touch the floor", "Add a `collision` shape to a part, or specify the position of the root.")
    START_BELOW = ("TC610", "mode that starts below the floor", "Raise the root: `at: {xyz: ...}`, or `at: {on: floor}`.", Stage.BUILD)
    START_CONTACT = ("TC611", "links that overlap at the start", "Change the pose or a shape, or exclude the contact.", Stage.BUILD)
    CHATTER = ("TC612", "unstable gain of a drive", "Lower the gain, set the rotor's `armature`, or use a shorter time step.", Stage.BUILD)
    POSE_MOVED = ("TC618", "pose changed to close a loop", "Write values that close the loops, or remove some of the values.", Stage.CHECK)
    OFF_FEET = ("TC790", "mode whose feet are not the lowest parts", "Start in a pose in which the feet are the lowest parts.", Stage.CHECK)
    START_LIMITS = ("TC791", "mode that starts outside joint limits", "Add a `pose` within the limits to the mode.", Stage.CHECK)
    COLLISION_MISSING = ("TC704", "missing collision shape", "Use another value of `collision`, or define `collision()` in the part class.")
    STATED = ("TC792", "implausible centre of mass or inertia", "Correct the number or its unit.", Stage.CHECK)
    # --- TC65x: tests of the document (thingc test) ----------------------------------------------------------------
    TEST_POSE = ("TC658", "pose that a test cannot use", "Use a pose in which the mode's loops close.")
    TEST_ALLOWANCE = ("TC659", "unused entry of `allow` in a test", "Remove the pair from `allow`.", Stage.TEST)
    # --- TC7xx: targets (emit) -------------------------------------------------------------------------------------
    RAW_UNKNOWN = ("TC701", "raw attribute of an unknown element", "Write the kind and the name of an element that exists in the model.")
    MJCF_REFUSED = ("TC702", "MuJoCo rejects the model", "Correct the document at the reported line.")
    MJCF_WARNING = ("TC703", "MuJoCo warns about the model", "Correct the document at the reported line.", Stage.BUILD)
    LOSS_DENIED = ("TC706", "export loss with `--deny-loss`", "Remove the feature from the document, or allow the loss.", Stage.DENY)
    RAW_FIXED = ("TC707", "raw attribute that is not allowed", "Use the document key that the help text shows.")
    TOO_LIGHT = ("TC708", "link too light for MuJoCo", "Correct the unit of the file, size or mass, or use `attach` instead of the joint.")
    SAME_NAME = ("TC709", "name clash in the files of a target", "Rename one of the two elements.")
    COMPAT = ("TC710", "model that another program rejects", "Change the reported value, or select other modes.", Stage.COMPAT)
    STEP_FAILED = ("TC752", "the STEP file could not be written", "Change the reported part, or use `--emit` without `step`.")
    UNSTATED = ("TC753", "target with unlisted files", "Ask the author of the package to add the file to `WRITES`.")
    PRINT_SIZE = ("TC754", "part larger than the print bed", "Set `bed` in `thingc.toml`, or print the part in another direction.")
    ASSEMBLY_ORDER = ("TC755", "impossible assembly order", "Change the position of the component in `order`.")
    SAME_FILE = ("TC751", "two definitions with the same file name", "Rename one of the two part files.")
    # --- TC8xx: folders and files (driver, command line) -----------------------------------------------------------
    COMMAND_LINE = ("TC801", "invalid command line", "Run `thingc COMMAND --help` to list the arguments and options.")
    NO_DOCUMENT = ("TC802", "missing document", "Write the path of an existing assembly document.")
    PARAMETER_OPTION = ("TC803", "invalid -p", "Write -p 'NAME=VALUE' with the name of a parameter of the document.")
    CHOICE_OPTION = ("TC809", "invalid --set", "Write --set 'joints.NAME.limit.upper=90 deg' or --set 'components.NAME.part=module:Class'.")
    UNEXPECTED = ("TC804", "unexpected files in the build folder", "Move the files away, or build into another folder with -o.")
    OUTPUT = ("TC805", "a file cannot be written", "Free disk space, or choose a writable folder with -o or --store.")
    PART_UNREADABLE = ("TC807", "a part file that cannot be loaded", "Fix the part file at the reported line.")
    NO_GRAPHICS = ("TC808", "images cannot be rendered", "Install EGL (Debian, Ubuntu: apt install libegl1), or set MUJOCO_GL.")
    WORKING_FOLDER = ("TC810", "the working folder does not exist", "Change to an existing folder, and run the command again.")
    INTERNAL = ("TC899", "an internal error of thingc", "Report the error with the output of --debug.")
    # --- TC9xx: variants (batch) -----------------------------------------------------------------------------------
    VARIANT_VALUE = ("TC901", "invalid value of a variant", "Correct the reported value, range or count.")
    VARIANT_CHOICE = ("TC902", "invalid choice of a variant", "Use a part, an assembly or a material that is valid at the path.")
    RULE = ("TC903", "invalid rule of a variants document", "Compare values of the same physical dimension: `mass < 2.5 kg`.")
    VARIANT_TARGET = ("TC904", "an unknown target", "Use a target that `thingc build --emit` supports.")
    DUPLICATE_VARIANT = ("TC905", "duplicate variant", "Remove one of the two variants.")
    RESULT = ("TC906", "a result that is not defined for a variant", "Remove the result, or add the missing mode or mount.")
    VARIANT_DIED = ("TC911", "the process of a variant crashed", "Run the `command` of the variant to find the cause.")
    VARIANT_HUNG = ("TC912", "a variant took too long", "Increase --timeout, or run the `command` of the variant to find the cause.")
    VARIANT_RAISED = ("TC913", "an internal error of thingc in a variant", "Report the error and its entry in the journal of the batch.")
    BATCH_LOCKED = ("TC921", "another batch uses this folder", "Wait for the other batch, or use another folder with -o.")
    BATCH_UNFINISHED = ("TC922", "the folder contains an unfinished batch", "Continue with --resume, or delete the folder.")
    BATCH_CHANGED = ("TC923", "the input of a batch has changed", "Undo the change, or start a new batch in another folder with -o.")
    NO_BATCH = ("TC924", "no unfinished batch to resume", "Start the batch without --resume.")
    RUNNERS = ("TC925", "the processes of a batch do not start", "Fix the reported cause, then continue with --resume.")
    CLUSTER = ("TC926", "the cluster does not respond", "Fix the reported cause, then continue with --resume.")

    # --- TC95x: robots of other formats (import) -------------------------------------------------------------------
    SOURCE_XML = ("TC951", "robot file that cannot be read", "Correct the reported line, or use a supported format.")
    SOURCE_VALUE = ("TC952", "invalid value in a robot file", "Correct the reported value.")
    SOURCE_TREE = ("TC953", "links and joints that are not a tree", "Keep one root link, and connect every other link to one parent.")
    SOURCE_INERTIA = ("TC954", "link with an impossible inertia", "Correct the mass or inertia, or use `--repair inertia=nearest`.")
    SOURCE_DOUBT = ("TC955", "suspicious value in a robot file", "Compare the reported values, and correct the wrong value.")
    SOURCE_FILE = ("TC956", "missing mesh of a robot file", "Specify `--package NAME=DIR` or `--mesh-root DIR`, or use `--no-meshes`.")
    SOURCE_CONFLICT = ("TC957", "conflict between a document and its source", "Write the correct value in the document.")
    SOURCE_LOSS = ("TC958", "loss of an import", "If you need the element, add it to the imported document.")
    # --- TC65x: kinds of tests of the document (documents/checks) --------------------------------------------------
    TEST_MASS = ("TC651", "mass outside its bounds", "Change parts that are too heavy or too light, or change the bound.")
    TEST_CENTRE = ("TC652", "centre of mass outside its box", "Move heavy parts, or enlarge the box.")
    TEST_REACH = ("TC653", "reach outside its bounds", "Change the lengths of parts, the limits of joints, or the bound.")
    TEST_POINT = ("TC654", "point out of reach", "Move the point, change parts or the limits of joints, or allow a greater distance.")
    TEST_COLLISION = ("TC655", "parts that collide", "Change a part, a pose or a range, or allow the collision with a reason.")
    TEST_TORQUE = ("TC656", "insufficient torque of a drive", "Use a stronger drive, lighter parts or another pose, or reduce the margin.")
    TEST_SETTLES = ("TC657", "robot that does not come to rest", "Change the pose, the drives or the bounds, or inspect the MuJoCo model.")
    TEST_FALLS = ("TC660", "robot that falls over", "Move the feet or heavy parts, or add feet to `standing_on`.")
    TEST_FOOT = ("TC661", "feet that do not touch the floor", "Change the pose, or list other mounts under `standing_on`.")
    TEST_CLEARANCE = ("TC662", "part too close to the ground", "Change a part or a pose, or exclude components with `except`.")
    TEST_UNDECIDED = ("TC663", "gap smaller than the mesh error", "Increase the gap, or use a finer `mesh` tolerance.", Stage.TEST)
    TEST_STACK = ("TC666", "deviation outside its bounds", "Tighten the tolerances that contribute most, or allow a larger deviation.")
    TEST_EMPTY = ("TC669", "test that compares no parts", "Add parts that can collide, or remove the test.", Stage.TEST)
    TEST_DRIVE = ("TC668", "drive that cannot follow a motion", "Use a stronger or faster drive or more time, or reduce the margin.")


class Note(OneLineStruct):
    """Additional information about a diagnostic, with an optional second location, such as "mount declared here".

    `Note` shortens its message in the same way as `Diagnostic`.
    """

    message: str
    span: Span | None = None

    def __post_init__(self) -> None:
        force_setattr(self, "message", abbreviate(self.message))


def make_notes(message: str, origin: Origin) -> tuple[Note, ...]:
    """Create a note with the text `message` at the innermost location of `origin`. Return an empty tuple if `origin` is empty."""
    return (Note(message=message, span=origin[0]),) if origin else ()


def first_notes(notes: Sequence[Note], limit: int, noun: str) -> list[Note]:
    """Return the first `limit` notes. If there are more, a last note states their number: `and 3 more parts` for the noun `more part`."""
    remaining = [Note(message=f"and {format_count(len(notes) - limit, noun)}")] if len(notes) > limit else []
    return [*notes[:limit], *remaining]


class Diagnostic(OneLineStruct):
    """A diagnostic: an error, a warning or a note about a document, a part or the command line.

    `path` is the key path in the document, or the path of the occurrence or joint. `detail` (such as the traceback of a part) is shown only
    with `--debug`. `fixes` are unambiguous edits for `thingc check --fix`. If `allow` is true, the output also shows how to suppress the
    warning. `Diagnostic` shortens `message` and `help` for all output formats.
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
    allow: bool = False

    @property
    def advice(self) -> str | None:
        """The help text, and the `allow` entry that suppresses the warning, if `allow` is true."""
        return self.help if not self.allow else f"{self.help}; {allow_hint(self.code)}" if self.help else allow_hint(self.code)

    def __post_init__(self) -> None:
        force_setattr(self, "message", abbreviate(self.message))
        if self.help is not None:
            force_setattr(self, "help", abbreviate(self.help))


class UserError(PicklableError):
    """Raised for an error that the user can fix, such as a wrong command line. `diagnostic` describes the error."""

    code: Code = Code.COMMAND_LINE

    def __init__(self, message: str, hint: Hint | None = None, code: Code | None = None, span: Span | None = None) -> None:
        super().__init__(message)
        self.diagnostic = Diagnostic(code=code or self.code, severity=Severity.ERROR, message=message, help=text_of(hint), span=span)


class Allowance(FrozenStruct, eq=False):
    """An entry of `allow:` in a document, which suppresses the warnings with one diagnostic code in a part of the document.

    The entry suppresses a warning of `code` if the location of the warning is inside one of the mappings in `nodes`. `nodes` contains pairs
    of a mapping and the span of its key. For a mode, `nodes` also contains the mappings of all modes that extend the mode. `where` is the
    location of the `allow` entry. `path` is the key path of the mapping that contains `allow:`.
    """

    code: Code
    reason: str
    where: Span
    path: str
    nodes: tuple[tuple[Span, Node], ...]

    def covers(self, code: Code, places: Collection[Span]) -> bool:
        """Return whether this `allow` entry suppresses a warning of `code` at one of the locations `places`."""
        return code is self.code and any(key.holds(place) or stands_in(node, place) for key, node in self.nodes for place in places)


def allow_hint(code: Code) -> str:
    """Return the help text that shows the user how to suppress warnings with this diagnostic code."""
    return f'to suppress this warning, add `allow: {{{code.code}: "the reason"}}`'


@dataclass(slots=True)
class Report:
    """Collects the diagnostics of all passes. All passes add to one report, which is the only mutable object that they share.

    The report suppresses each warning that one of its `allowances` covers. `needed` contains the allowances that suppressed a warning, and
    `allowed` is the number of suppressed warnings.
    """

    diagnostics: list[Diagnostic] = field(default_factory=list)
    allowances: Sequence[Allowance] = ()
    needed: set[Allowance] = field(default_factory=set)
    allowed: int = 0
    _known: set[Diagnostic] = field(default_factory=set, repr=False)

    def add(
        self, code: Code, message: Hint, where: Span | Origin | None, *, help: Hint | None = None, path: str | None = None,
        notes: Iterable[Note] = (), severity: Severity = Severity.ERROR, detail: str | None = None, allow: bool = False,
    ) -> bool:
        """Add a diagnostic at the location `where`. For an `Origin`, the location is the innermost span, and the other spans become notes.

        If the message or the help text is an unambiguous `Suggestion`, the diagnostic gets an automatic fix. Return False if an `allow`
        entry of the document suppresses the diagnostic, otherwise True.
        """
        spans = () if where is None else (where,) if isinstance(where, Span) else where
        span = spans[0] if spans else None
        outer_notes = (Note(message="included from here", span=outer) for outer in spans[1:])
        diagnostic = Diagnostic(
            code=code, severity=severity, message=str(message), span=span, path=path, help=text_of(help),
            notes=(*notes, *outer_notes), detail=detail, fixes=_fixes(span, message, help), allow=allow,
        )
        return self.say(diagnostic)

    def say(self, diagnostic: Diagnostic) -> bool:
        """Add a diagnostic, unless the report already contains an equal one. Return False if an `allow` entry suppresses the diagnostic."""
        diagnostic = _of_option(diagnostic)
        places = [place for place in (diagnostic.span, *(note.span for note in diagnostic.notes)) if place is not None]
        if diagnostic.severity is Severity.WARNING and self.allows(diagnostic.code, places):
            return False
        if diagnostic not in self._known:
            self._known.add(diagnostic)
            self.diagnostics.append(diagnostic)
        return True

    def allows(self, code: Code, places: Collection[Span]) -> bool:
        """Return whether an `allow` entry suppresses warnings with this code at one of these locations.

        An entry that suppresses the warning is recorded in `needed`.
        """
        covering = [allowance for allowance in self.allowances if allowance.covers(code, places)]
        self.needed.update(covering)
        self.allowed += bool(covering)
        return bool(covering)

    def warn(
        self, code: Code, message: Hint, where: Span | Origin | None, *, help: Hint | None = None, path: str | None = None,
        notes: Iterable[Note] = (), allow: bool = False,
    ) -> bool:
        """Add a warning to the report. The arguments have the same meaning as for `add`."""
        return self.add(code, message, where, help=help, path=path, notes=notes, severity=Severity.WARNING, allow=allow)

    def copy(self) -> Report:
        """Return an independent copy of this report. Diagnostics that are added to the copy are not added to this report."""
        return Report(list(self.diagnostics), self.allowances, set(self.needed), self.allowed, set(self._known))

    def say_unneeded(self, document: str, stages: Collection[Stage]) -> None:
        """Report a warning for each `allow` entry of a document that did not suppress any warning. `document` is an absolute path.

        Only entries for warnings that one of the commands in `stages` reports are checked. Entries of nested documents are skipped, because
        other robots that use these documents may need them.
        """
        for allowance in self.allowances:
            if allowance.where.file == document and allowance.code.warned_by in stages and allowance not in self.needed:
                where = f"`{allowance.path}`" if allowance.path else "the document"
                self.warn(
                    Code.UNNEEDED, f"unused `allow` entry `{allowance.code.code}` ({allowance.code.title}) in {where}",
                    allowance.where, path=f"{allowance.path}.allow".lstrip("."),
                    help=f"remove `{allowance.code.code}` from `allow`",
                    notes=[Note(message=f"reason for the allowance: {allowance.reason}")],
                )

    @property
    def failed(self) -> bool:
        """Whether the report contains at least one error."""
        return any(d.severity is Severity.ERROR for d in self.diagnostics)

    def sorted_diagnostics(self) -> list[Diagnostic]:
        """Return the diagnostics sorted by file, line and column. Diagnostics at the same location keep the order in which they were added.

        Diagnostics without a location are last.
        """
        return sorted(
            self.diagnostics,
            key=lambda d: (d.span is None, d.span.file if d.span else "", *((d.span.line, d.span.column) if d.span else (0, 0))),
        )

    def apply_strict(self, *, strict: bool) -> Report:
        """Return this report. With `strict`, return a copy of the report in which every warning has become an error."""
        return self if not strict else Report([
            replace(d, severity=Severity.ERROR) if d.severity is Severity.WARNING else d for d in self.diagnostics
        ])


def _of_option(diagnostic: Diagnostic) -> Diagnostic:
    """Convert a diagnostic about a value that the option `--set` specifies: the text of the option replaces the location in a file."""
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


def _fixes(span: Span | None, *hints: Hint | None) -> tuple[Edit, ...]:
    fix = next((hint.fix for hint in hints if isinstance(hint, Suggestion) and hint.fix is not None), None)
    return (Edit(span=span, written=fix[0], replacement=fix[1]),) if fix is not None and span is not None else ()


def shown_path(file: str) -> str:
    """Return the display path of a file: relative to the working folder for files near this folder, otherwise normalized."""
    try:
        relative = os.path.relpath(file)
    except (OSError, ValueError):  # the working folder was deleted, or the file name is invalid
        return file
    return os.path.normpath(file) if relative.startswith(os.path.join("..", "..", "..")) else relative
