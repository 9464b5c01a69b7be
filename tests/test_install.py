"""Settings of pip hold for uv, which installs the environment of the checks."""

import os
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

INSTALLING = runpy.run_path(str(ROOT / "requirements" / "install.py"))
settings_for_uv, variables_for_uv = INSTALLING["settings_for_uv"], INSTALLING["variables_for_uv"]


def test_index_folders_certificates_and_time_outs_are_passed_on():
    found = settings_for_uv(
        {
            "PIP_CONFIG_FILE": os.devnull,  # no files at all
            "PIP_INDEX_URL": "https://name:p%40ss@a.example/simple",
            "PIP_EXTRA_INDEX_URL": "https://b.example/x https://c.example/y",
            "PIP_FIND_LINKS": "/one /two",
            "PIP_CERT": "/ca.pem",
            "PIP_TIMEOUT": "5",
            "PIP_TRUSTED_HOST": "a.example",
            "PIP_QUIET": "1",
        }
    )
    assert found == {
        "UV_DEFAULT_INDEX": "https://name:p%40ss@a.example/simple",
        "UV_INDEX": "https://b.example/x https://c.example/y",
        "UV_FIND_LINKS": "/one,/two",
        "SSL_CERT_FILE": "/ca.pem",
        "UV_HTTP_TIMEOUT": "5",
        "UV_INSECURE_HOST": "a.example",
    }


def test_environment_goes_before_files_and_installing_before_all_commands():
    listing = """
:env:.timeout='9'
global.index-url='https://a.example'
global.timeout='7'
global.find-links='\\n/one\\n/two'
install.index-url='https://b.example'
install.timeout='8'
install.find-links=''
freeze.timeout='1'
"""
    assert variables_for_uv(listing) == {
        "UV_DEFAULT_INDEX": "https://b.example",
        "UV_HTTP_TIMEOUT": "9",
        "UV_FIND_LINKS": "/one,/two",
    }


@pytest.mark.parametrize(
    "listing",
    [
        ":env:.no-index='1'",
        "global.proxy='http://proxy.example:3128'",
        "global.find-links='~/wheels'",
        "global.index-url='https://a.example'\nglobal.index-url='https://b.example'",
    ],
)
def test_pip_installs_where_only_it_has_what_is_set(listing):
    assert variables_for_uv(listing) is None


def test_pip_installs_where_its_file_is_damaged(tmp_path):
    (tmp_path / "pip.conf").write_text("[global]\nindex-url\n", encoding="utf-8")
    assert settings_for_uv({"PIP_CONFIG_FILE": str(tmp_path / "pip.conf")}) is None
