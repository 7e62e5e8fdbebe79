"""The wheel plays where nothing else of the project is: no checkout, and no package that it does not ask for."""

import json
import os
import re
import subprocess
import sys
import tarfile
import tomllib
import venv
import zipfile
from importlib.metadata import distribution

import pytest
import tomli_w
from packaging.requirements import Requirement

from apollonius.arenas.file import to_dict
from apollonius.io.cache import VARIABLE
from apollonius.version import __version__
from tests.documents import REPOSITORY, blocks
from tests.learn.tiny import RUN

pytestmark = pytest.mark.slow
PROJECT = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]


@pytest.fixture(scope="module")
def archives(tmp_path_factory):
    out = tmp_path_factory.mktemp("dist")
    build = [sys.executable, "-m", "hatchling", "build", "--directory", out]
    subprocess.run(build, cwd=REPOSITORY, check=True, capture_output=True, timeout=120)
    return out


def needed_names(requirements, extras=("",)):
    """Names of the installed distributions that requirements ask for, and those that these ask for."""
    asked = [
        one
        for one in map(Requirement, requirements)
        if one.marker is None or any(one.marker.evaluate({"extra": extra}) for extra in extras)
    ]
    further = (needed_names(distribution(one.name).requires or [], ("", *one.extras)) for one in asked)
    return {one.name for one in asked}.union(*further)


def environment(folder, archives, *extras):
    """A virtual environment of the wheel and what it asks for, no more; returns its `bin`."""
    venv.create(folder, symlinks=True)
    packages = next(folder.glob("lib/python*/site-packages"))
    asked = [*PROJECT["dependencies"], *(line for extra in extras for line in PROJECT["optional-dependencies"][extra])]
    for name in needed_names(asked):
        files = distribution(name).files or []
        for top in {file.parts[0] for file in files} - {"..", "__pycache__"}:
            if not (packages / top).exists():
                (packages / top).symlink_to(distribution(name).locate_file(top))
    install = [sys.executable, "-m", "pip", "--python", folder / "bin" / "python", "install", "--no-deps", "--no-index"]
    subprocess.run([*install, *archives.glob("*.whl")], check=True, capture_output=True, timeout=120)
    return folder / "bin"


def run(command, *arguments, cwd):
    """What a command of an environment prints; compilations are kept with those of the other tests."""
    kept = {name: os.environ[name] for name in ("PATH", VARIABLE)}
    result = subprocess.run([command, *arguments], cwd=cwd, env=kept, capture_output=True, text=True, timeout=300)
    assert result.returncode == 0, result.stderr
    return result.stdout


def test_wheel_without_extras_plays_exports_and_writes_the_page(archives, tmp_path):
    bin_ = environment(tmp_path / "plain", archives)
    where = "import apollonius, importlib.util as u; print(apollonius.__file__, u.find_spec('matplotlib'))"
    file, matplotlib = run(bin_ / "python", "-c", where, cwd=tmp_path).split()
    assert (file.startswith(f"{tmp_path / 'plain'}/lib"), matplotlib) == (True, "None")
    arguments = ("evaluate", "P_curriculum", "E_scratch", "--game", "office", "--games", "20", "--json")
    assert sum(json.loads(run(bin_ / "apollonius", *arguments, cwd=tmp_path))["outcomes"].values()) == 20
    run(bin_ / "apollonius", "play", "--site", "site", cwd=tmp_path)
    assert {"index.html", "compiled.js", "style.css"} <= {path.name for path in (tmp_path / "site").iterdir()}
    run(bin_ / "apollonius", "export", "P_stage1", "--to", "c", "--out", "P.c", cwd=tmp_path)
    run(bin_ / "apollonius", "show", "P_stage1", "still", "--out", "game.gif", cwd=tmp_path)
    assert (tmp_path / "game.gif").read_bytes().startswith(b"GIF89a")


def test_wheel_has_the_translator_as_a_package_that_stands_alone(archives, tmp_path):
    bin_ = environment(tmp_path / "plain", archives)
    (example,) = (block.code for block in blocks(REPOSITORY / "jaxpr2c" / "README.md") if block.language == "python")
    modules = 'import sys\nprint(jaxpr2c.__file__, "apollonius" in sys.modules, "equinox" in sys.modules)'
    (tmp_path / "example.py").write_text(f"{example}\n{modules}\n", encoding="utf-8")
    file, *others = run(bin_ / "python", "example.py", cwd=tmp_path).split()
    assert (file.startswith(f"{tmp_path / 'plain'}/lib"), others) == (True, ["False", "False"])
    assert {"pendulum.c", "pendulum.h", "pendulum.weights"} <= {path.name for path in tmp_path.iterdir()}


def test_wheel_with_extras_reports_and_makes_an_environment(archives, tmp_path):
    bin_ = environment(tmp_path / "extras", archives, "plot", "gym")
    (tmp_path / "tiny.toml").write_text(tomli_w.dumps(to_dict(RUN)))
    run(bin_ / "apollonius", "train", "--config", "tiny.toml", "--out", "run", cwd=tmp_path)
    run(bin_ / "apollonius", "report", "run", cwd=tmp_path)
    assert (tmp_path / "run" / "report.html").stat().st_size > 10_000
    both = "import apollonius; print(sorted(apollonius.parallel_env().reset(seed=0)[0]))"
    assert run(bin_ / "python", "-c", both, cwd=tmp_path) == "['evader_0', 'pursuer_0']\n"


def test_wheel_and_source_archive_have_their_metadata(archives):
    pytest.importorskip("twine", reason="needs twine: pip install twine")
    check = [sys.executable, "-m", "twine", "check", "--strict", *archives.iterdir()]
    subprocess.run(check, check=True, capture_output=True, timeout=120)
    names = zipfile.ZipFile(archives / f"apollonius-{__version__}-py3-none-any.whl").namelist()
    files = {"apollonius/py.typed", "jaxpr2c/py.typed", "jaxpr2c/__init__.pyi", "jaxpr2c/README.md"}
    assert files | {f"apollonius-{__version__}.dist-info/licenses/LICENSE"} <= set(names)
    assert not [name for name in names if not name.startswith(("apollonius", "jaxpr2c/"))]
    with tarfile.open(archives / f"apollonius-{__version__}.tar.gz") as archive:
        inside = {name.split("/", 1)[1] for name in archive.getnames()}
    assert {"LICENSE", "README.md", "CHANGELOG.md", "CITATION.cff", "tests/test_packaging.py"} <= inside


def test_version_is_the_same_everywhere():
    assert f"\nversion: {__version__}\n" in (REPOSITORY / "CITATION.cff").read_text()
    assert re.search(rf"^## \[(Unreleased|{re.escape(__version__)})\]", (REPOSITORY / "CHANGELOG.md").read_text(), re.M)


def test_lock_files_have_hashes_and_no_addresses():
    for lock in REPOSITORY.glob("requirements*.lock"):
        text = lock.read_text()
        assert "://" not in text
        pinned, hashed = r"^[\w.-]+(\[.*\])?==", r"^[\w.-]+(\[.*\])?==.*\\\n +--hash=sha256:"
        assert len(re.findall(pinned, text, re.M)) == len(re.findall(hashed, text, re.M)) > 20
