"""The Python file: what it imports, what it says."""

import json
import subprocess
import sys

import pytest

from apollonius.adapters.export import numpy as export
from tests.adapters.export.conftest import ONE_OF_EACH, ONE_OF_EACH_PROFILE

ALONE = """
import json, sys
before = set(sys.modules)
sys.path.insert(0, sys.argv[1])
import policy
answer = policy.decide(json.loads(sys.argv[2]))
foreign = {name.split(".")[0] for name in set(sys.modules) - before} - set(sys.stdlib_module_names)
print(json.dumps([answer, sorted(foreign)]))
"""


def written(case, folder):
    for path, content in export.make_files(case.blueprint, folder / "policy.py").items():
        path.write_bytes(content)
    return folder / "policy.py"


@pytest.mark.parametrize("case", ONE_OF_EACH, indirect=True)
def test_it_needs_numpy_alone(case, tmp_path):
    written(case, tmp_path)
    state = json.dumps(case.states[0].tolist())
    run = subprocess.run(
        [sys.executable, "-c", ALONE, str(tmp_path), state], check=True, capture_output=True, text=True
    )
    (*action, u1, u2), foreign = json.loads(run.stdout)
    assert action == ([] if case.blueprint.continuous else [case.actions[0]])
    assert [u1, u2] == pytest.approx(case.controls[0].tolist(), rel=1e-4)
    assert foreign == ["numpy", "policy"]


@pytest.mark.parametrize("case", ONE_OF_EACH_PROFILE, indirect=True)
def test_anything_but_eight_numbers_is_refused(case, tmp_path):
    names = {}
    exec(written(case, tmp_path).read_text(), names)
    with pytest.raises(ValueError, match="8 numbers, not 7"):
        names["decide"]([0.0] * 7)
