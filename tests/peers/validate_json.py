"""Validates JSON files against a JSON Schema with PyPI jsonschema.

Arguments: the schema, then the files. Prints one line for each error; exit code 0 also with errors.
"""

import json
import sys

from jsonschema import Draft202012Validator

schema_path, *paths = sys.argv[1:]
with open(schema_path, encoding="utf-8") as file:
    schema = json.load(file)
Draft202012Validator.check_schema(schema)
validator = Draft202012Validator(schema)
for path in paths:
    with open(path, encoding="utf-8") as file:
        value = json.load(file)
    for error in validator.iter_errors(value):
        print(f"{path}: {error.json_path}: {error.validator}: {error.message[:200]}")
