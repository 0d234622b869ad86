"""Document models and their check. They are imported late: pydantic costs more than reading a document."""

from __future__ import annotations

from typing import TYPE_CHECKING

from thingc.base.exports import exported

if TYPE_CHECKING:
    from thingc.documents.spec.doubts import Specs
    from thingc.documents.spec.fields import REFERENCE_PATTERN
    from thingc.documents.spec.mentions import Mention, mentions_of, referred, setting_words
    from thingc.documents.spec.named import Declares, Means, Meant
    from thingc.documents.spec.saying import within
    from thingc.documents.spec.schema import json_schema
    from thingc.documents.spec.stated import dimension_stated, nested_document, stated_choices, stated_parameter, stated_value, whole_drive
    from thingc.documents.spec.validation import part_references, validate, validate_one

__all__ = [
    "REFERENCE_PATTERN", "Declares", "Means", "Meant", "Mention", "Specs", "dimension_stated", "json_schema", "mentions_of",
    "nested_document", "part_references", "referred", "setting_words", "stated_choices", "stated_parameter", "stated_value", "validate",
    "validate_one", "whole_drive", "within",
]

__getattr__ = exported(__name__, {
    "REFERENCE_PATTERN": "fields", "Declares": "named", "Means": "named", "Meant": "named", "Mention": "mentions", "Specs": "doubts",
    "dimension_stated": "stated", "json_schema": "schema", "mentions_of": "mentions", "nested_document": "stated",
    "part_references": "validation",
    "referred": "mentions", "setting_words": "mentions", "stated_choices": "stated", "stated_parameter": "stated", "stated_value": "stated",
    "validate": "validation", "validate_one": "validation", "whole_drive": "stated", "within": "saying",
})
