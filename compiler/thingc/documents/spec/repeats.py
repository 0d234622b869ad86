"""The key `repeat` of components, joints and transmissions."""

from pydantic import Field

from thingc.documents.spec.base import Model
from thingc.documents.spec.fields import CountField
from thingc.documents.spec.name_types import NewIndex


class RepeatSpec(Model):
    """A repeat, which creates the copies `name_0` to `name_{count-1}`."""

    count: CountField
    as_: NewIndex = Field(default="i", alias="as", description="The index: in expressions `i`, in references `$i`.")
