"""Run a checker on files, in the environment of the checker: `python findings.py FILES FINDINGS FUNCTION PACKAGE`.

A checker is a function that yields the level (`error` or `warning`) and the message of each finding for a file. Readers of robot files are
checkers, too: what they print or warn of is a finding, and so are links, joints and masses that differ from those of the file. Packages are
imported in the functions, because each environment contains the packages of only one checker.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import re
import subprocess
import sys
import tempfile
import warnings
import xml.etree.ElementTree as ElementTree
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

LEVELS = {"ERROR": "error", "WARN": "warning", "INFO": "info"}
MOVING = ("revolute", "continuous", "prismatic")


# USD


def usdchecker(file):
    from pxr import UsdValidation

    yield from validated(file, UsdValidation.ValidationRegistry().GetOrLoadAllValidators())


def simready_validate(file):
    import simready.validate as simready

    if not simready.get_available_profiles():
        simready.initialize(rules_and_requirements_paths=[], features_paths=[], profiles_paths=[])
    config = simready.AssetValidationConfig(asset_path=file, profile_id="Robot-Body", profile_version="3.0.0")
    result = simready.validate_asset(config)
    failing = {name: feature.get("failing requirements", "") for name, feature in result.features_summary.items()}
    for issue in result.issues:
        features = [name for name, codes in failing.items() if f"'{issue.code}'" in codes]
        level = "error" if any(name in SIMREADY_REQUIRED for name in features) else "info"
        yield level, f"{issue.code.rpartition('.simready.')[2]}: {', '.join(features)}: {issue.message}"


SIMREADY_REQUIRED = ("FET_001_STANDARD", "FET_003_STANDARD", "FET_006_STANDARD", "FET_031_STANDARD", "FET_033_STANDARD")
"""Features that the profile Robot-Body 3.0.0 requires. Other features, of single simulators, are optional."""


def ros_openusd_compliance_checker(file):
    from compliance_checker.checker import ComplianceChecker

    for found in ComplianceChecker.from_path(file, include_export=True, include_extended=True).run().violations:
        yield found.severity.value, f"{found.check_id}: {found.message}"


def validated(file, validators):
    from pxr import Usd, UsdValidation

    for found in UsdValidation.ValidationContext(validators).Validate(Usd.Stage.Open(file)):
        level = "error" if found.GetType() == UsdValidation.ValidationErrorType.Error else "warning"
        yield level, f"{found.GetName()}: {found.GetMessage()}"


def isaaclab_robot_doctor(file):
    from isaaclab_robot_doctor.checks import run_checks
    from isaaclab_robot_doctor.loader import load_robot

    yield from ((LEVELS[one.severity], f"{one.id}: {one.message}") for one in run_checks(load_robot(file)))


# URDF


def check_urdf(file):
    done = subprocess.run(["check_urdf", file], check=False, capture_output=True, text=True)
    yield from (("error", line) for line in done.stderr.splitlines())
    if done.returncode and not done.stderr:
        yield "error", f"exit code {done.returncode}"
    found = re.findall(r"(?:root Link: (.+) has |child\(\d+\):  (.+))", done.stdout)
    yield from differences(file, links=["".join(names) for names in found])


def urdf_validator(file):
    from urdf_validator_main import cli

    with tempfile.TemporaryDirectory() as folder:
        sys.argv = ["urdf_validate", file, "--output-dir", folder]
        with contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()):
            cli.main()
        (answer,) = os.listdir(folder)
        with open(os.path.join(folder, answer)) as stream:
            report = json.load(stream)
    yield from (("error", one) for one in dict.fromkeys((*report["schema"]["critical_issues"], *report["critical_issues"])))
    yield from (("warning", one) for one in dict.fromkeys((*report["schema"]["warnings"], *report["warnings"])))


def yourdfpy(file):
    import yourdfpy

    robot = yourdfpy.URDF.load(file)
    if not robot.validate():
        yield from (("error", str(one)) for one in robot.errors)
    moving = [name for name, joint in robot.joint_map.items() if joint.type in MOVING]
    mass = sum(link.inertial.mass for link in robot.robot.links if link.inertial is not None)
    yield from differences(file, links=robot.link_map, joints=moving, mass=mass)


def urdf_parser_py(file):
    from urdf_parser_py.urdf import URDF
    from urdf_parser_py.xml_reflection import core

    messages = []
    core.on_error = messages.append
    with open(file, "rb") as stream:
        robot = URDF.from_xml_string(stream.read())
    yield from (("warning", one) for one in messages)
    moving = [name for name, joint in robot.joint_map.items() if joint.type in MOVING]
    mass = sum(link.inertial.mass for link in robot.links if link.inertial is not None)
    yield from differences(file, links=robot.link_map, joints=moving, mass=mass)


def pinocchio(file):
    import pinocchio

    model, *_ = pinocchio.buildModelsFromUrdf(file, package_dirs=os.path.dirname(file), root_joint=pinocchio.JointModelFreeFlyer())
    links = [frame.name for frame in model.frames if frame.type == pinocchio.FrameType.BODY]
    yield from differences(file, links=links, joints=list(model.names)[2:], mass=sum(one.mass for one in model.inertias))


def pybullet(file):
    import pybullet

    if not pybullet.isConnected():
        pybullet.connect(pybullet.DIRECT)
    pybullet.resetSimulation()
    robot = pybullet.loadURDF(file, flags=pybullet.URDF_USE_INERTIA_FROM_FILE)
    infos = [pybullet.getJointInfo(robot, k) for k in range(pybullet.getNumJoints(robot))]
    links = [pybullet.getBodyInfo(robot)[0].decode(), *(info[12].decode() for info in infos)]
    moving = [info[1].decode() for info in infos if info[2] != pybullet.JOINT_FIXED]
    masses = [pybullet.getDynamicsInfo(robot, k)[0] for k in range(-1, len(infos))]
    yield from differences(file, links=links, joints=moving, mass=sum(masses))


def ikpy(file):
    from ikpy.chain import Chain

    joints = ElementTree.parse(file).getroot().findall("joint")
    roots = {one.find("parent").attrib["link"] for one in joints} - {one.find("child").attrib["link"] for one in joints}
    for root in roots:
        chain = Chain.from_urdf_file(file, base_elements=[root], symbolic=False)
        if any(one.attrib["type"] in MOVING for one in joints) and all(link.joint_type == "fixed" for link in chain.links):
            yield "error", "the chain that ikpy selects does not move"


def scikit_robot(file):
    from skrobot.models.urdf import RobotModelFromURDF

    robot = RobotModelFromURDF(urdf_file=file)
    yield from differences(file, links=[link.name for link in robot.link_list], joints=[joint.name for joint in robot.joint_list])


def roboticstoolbox(file):
    import roboticstoolbox

    links = roboticstoolbox.Robot.URDF(file).links
    yield from differences(file, links=[link.name for link in links], mass=sum(link.m for link in links))


def urchin(file):
    import urchin

    robot = urchin.URDF.load(file, lazy_load_meshes=True)
    moving = [joint.name for joint in robot.joints if joint.joint_type in MOVING]
    yield from differences(file, links=robot.link_map, joints=moving)


def idyntree(file):
    from idyntree.bindings import ModelLoader

    loader = ModelLoader()
    if loader.loadModelFromFile(file):
        model = loader.model()
        moving = [model.getJointName(k) for k in range(model.getNrOfJoints()) if model.getJoint(k).getNrOfDOFs()]
        yield from differences(file, joints=moving, mass=model.getTotalMass())
    else:
        yield "error", "iDynTree does not load the file"


def dartpy(file):
    import dartpy

    robot = dartpy.utils.DartLoader().parseSkeleton(file)
    links = [robot.getBodyNode(k) for k in range(robot.getNumBodyNodes())]
    moving = [link.getParentJoint().getName() for link in links if link.getParentBodyNode() and link.getParentJoint().getNumDofs()]
    yield from differences(file, links=[link.getName() for link in links], joints=moving, mass=robot.getMass())


def placo(file):
    import placo

    robot = placo.RobotWrapper(file)
    yield from differences(file, joints=list(robot.joint_names()))


# MJCF


def mjcf_doctor(file):
    import mujoco
    from mjcf_doctor import diagnose

    for one in diagnose(mujoco.MjModel.from_xml_path(file)).findings:
        yield LEVELS[one.level.name], f"{one.code}: {one.subject}: {one.message}"


def mujoco(file):
    import mujoco

    model = mujoco.MjModel.from_xml_path(file)
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_step(model, data, 10)
    for kind, one in zip(mujoco.mjtWarning.__members__, data.warning):
        if one.number:
            yield "warning", f"{kind}: {one.number} times in 10 steps"


# SDF


@cache
def sdf_reader():
    import ask_libsdformat

    return ask_libsdformat.answering(ask_libsdformat.program(Path(tempfile.mkdtemp())))


def libsdformat(file):
    sdf_reader()({"file": file})
    yield from ()


def gz_sdf(file):
    done = subprocess.run(["gz", "sdf", "-k", file], check=False, capture_output=True, text=True)
    yield from (("error", line) for line in (done.stdout + done.stderr).splitlines() if line and line != "Valid.")


# Several formats


def genesis(file):
    import genesis

    if not genesis._initialized:
        genesis.init(backend=genesis.cpu, logging_level="warning")
    morph = genesis.morphs.URDF(file=file) if file.endswith(".urdf") else genesis.morphs.MJCF(file=file)
    robot = genesis.Scene(show_viewer=False).add_entity(morph)
    if file.endswith(".urdf"):
        yield from differences(file, joints=[joint.name for joint in robot.joints if joint.n_dofs and joint.name != "root_joint"])


def newton(file):
    with contextlib.redirect_stdout(io.StringIO()):  # Warp prints which kernels it loads
        import newton

        builder = newton.ModelBuilder()
        if file.endswith(".urdf"):
            builder.add_urdf(file)
        else:
            builder.add_usd(file)
        builder.finalize(device="cpu")
    yield from ()


def differences(file, links=None, joints=None, mass=None):
    """Yield an error for each difference between a URDF file and what a reader made of it."""
    robot = ElementTree.parse(file).getroot()
    names = {one.attrib["name"] for one in robot.findall("link")}
    moving = {one.attrib["name"] for one in robot.findall("joint") if one.attrib["type"] in MOVING}
    free = {one.attrib["name"] for one in robot.findall("joint") if one.attrib["type"] == "floating"}  # a joint only for some readers
    for what, expected, found in (("links", names, links), ("joints", moving, None if joints is None else set(joints) - free)):
        if found is not None and set(found) != expected:
            yield "error", f"{what} missing {sorted(expected - set(found))}, added {sorted(set(found) - expected)}"
    total = sum(float(one.attrib["value"]) for one in robot.iter("mass"))
    if mass is not None and abs(mass - total) > 1e-6 * total:
        yield "error", f"total mass {mass:.9g} kg instead of {total:.9g} kg"


def checked(check, file):
    """Return the findings of a checker for a file, including all lines that it prints and all warnings that Python issues.

    Warnings of Python about the code of the checker, such as a file that it does not close, are left out.
    """
    with warnings.catch_warnings(record=True) as issued, tempfile.TemporaryFile("w+", errors="replace") as stream:
        warnings.simplefilter("always")
        with written_to(stream.fileno()):
            findings = list(check(file))
        stream.seek(0)
        printed = [line.strip() for line in stream if line.strip()]
    issued = [str(one.message) for one in issued if not issubclass(one.category, (DeprecationWarning, ResourceWarning))]
    return [*findings, *(("warning", line) for line in (*printed, *issued) if "DeprecationWarning" not in line)]


@contextlib.contextmanager
def written_to(file):
    """Redirect everything that this process prints to a file, including what libraries in C++ print."""
    sys.stdout.flush()
    saved = [os.dup(descriptor) for descriptor in (1, 2)]
    try:
        for descriptor in (1, 2):
            os.dup2(file, descriptor)
        yield
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        for descriptor, one in zip((1, 2), saved):
            os.dup2(one, descriptor)
            os.close(one)


if __name__ == "__main__":
    from asking import serve

    check, package = globals()[sys.argv[3]], sys.argv[4]
    try:
        number = version(package)
    except PackageNotFoundError:
        number = ""
    serve(lambda asked: {"findings": checked(check, asked["file"])}, number, sys.argv)
