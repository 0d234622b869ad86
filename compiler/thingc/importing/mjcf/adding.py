"""Actuators and equalities that the language has no words for, as elements that are added to MuJoCo's model."""

from __future__ import annotations

from thingc.importing.mjcf.original import SOLIMP, SOLREF, Original, differing, floats, numbers
from thingc.importing.mjcf.tendons import Tendons
from thingc.importing.model import SourceAdded, SourceTarget

AT_JOINT, AT_PARENT, AT_CRANK, AT_TENDON, AT_SITE = 0, 1, 2, 3, 4
OF_TENDONS = 3
DYNAMICS = ("none", "integrator", "filter", "filterexact", "muscle")
GAINS, BIASES = ("fixed", "affine", "muscle"), ("none", "affine", "muscle")


class Added:
    """`joints` and `sites` are the numbers of those that are kept, `tendons` what is kept of these."""

    def __init__(self, original: Original, joints: set[int], sites: set[int], tendons: Tendons) -> None:
        self.original, self.model, self.joints, self.sites, self.tendons = original, original.model, joints, sites, tendons.of
        self.actuators: list[SourceAdded] = []
        self.equalities: list[SourceAdded] = []

    def actuator(self, number: int) -> bool:
        """Whether it is one that can be added, and is from now on."""
        model, acts_on = self.model, self._acts_on(number)
        words = [
            names[at] if (at := int(getattr(model, f"actuator_{word}type")[number])) < len(names) else ""
            for word, names in (("dyn", DYNAMICS), ("gain", GAINS), ("bias", BIASES))
        ]
        if not acts_on or not all(words):
            return False
        wanted = [*zip(("dyntype", "gaintype", "biastype"), words, strict=True)]
        wanted += [(f"{word}prm", numbers(getattr(model, f"actuator_{word}prm")[number])) for word in ("dyn", "gain", "bias")]
        wanted += [("gear", numbers(model.actuator_gear[number]))]
        for word in ("ctrl", "force", "act"):
            if getattr(model, f"actuator_{word}limited")[number]:
                wanted.append((f"{word}range", numbers(getattr(model, f"actuator_{word}range")[number])))
        if any(floats(model.actuator_lengthrange[number])):
            wanted.append(("lengthrange", numbers(model.actuator_lengthrange[number])))
        if int(model.actuator_trntype[number]) == AT_CRANK:
            wanted.append(("cranklength", numbers([model.actuator_cranklength[number]])))
        usual = {"dyntype": "none", "gaintype": "fixed", "biastype": "none", "gear": "1 0 0 0 0 0"}
        self.actuators.append(SourceAdded(
            section="actuator", tag="general", name=self.original.actuators[number],
            attributes=(*acts_on, *differing(wanted, usual)), where=self.original.where("actuator", number),
        ))
        return True

    def _acts_on(self, number: int) -> tuple[tuple[str, SourceTarget], ...]:
        """What an actuator acts on, by the attributes that name it; nothing where that is not there."""
        kind, ends = int(self.model.actuator_trntype[number]), [int(one) for one in self.model.actuator_trnid[number]]
        first = ends[0]
        if kind == AT_TENDON and first in self.tendons:
            return (("tendon", SourceTarget(kind="tendon", name=self.tendons[first].name)),)
        if kind in (AT_JOINT, AT_PARENT) and first in self.joints and int(self.model.jnt_type[first]) > 1:
            return (("joint", SourceTarget(kind="joint", name=self.original.joints[first])),)
        keys = {AT_SITE: ("site", "refsite"), AT_CRANK: ("cranksite", "slidersite")}.get(kind, ())
        named = tuple((key, site) for key, site in zip(keys, ends, strict=True) if site >= 0) if keys else ()
        if not all(site in self.sites for _, site in named):
            return ()
        return tuple((key, SourceTarget(kind="site", name=self.original.sites[site])) for key, site in named)

    def equality(self, number: int) -> bool:
        """Whether it is one of tendons that can be added, and is from now on. It is of lengths beyond those at the reference, which is
        q = 0 in a document."""
        model = self.model
        ends = [at for at in (int(model.eq_obj1id[number]), int(model.eq_obj2id[number])) if at >= 0]
        referred = any(model.qpos0[model.jnt_qposadr[joint]] for joint in self.joints if int(model.jnt_type[joint]) > 1)
        if referred or int(model.eq_type[number]) != OF_TENDONS or not all(at in self.tendons for at in ends):
            return False
        tied = ((f"tendon{k}", SourceTarget(kind="tendon", name=self.tendons[at].name)) for k, at in enumerate(ends, 1))
        said = [("polycoef", numbers(model.eq_data[number][:5])), ("solref", numbers(model.eq_solref[number]))]
        said.append(("solimp", numbers(model.eq_solimp[number])))
        self.equalities.append(SourceAdded(
            section="equality", tag="tendon", name=self.original.equalities[number],
            attributes=(*tied, *differing(said, {"solref": SOLREF, "solimp": SOLIMP})), where=self.original.where("equality", number),
        ))
        return True
