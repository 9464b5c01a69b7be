"""Settings of pip hold for uv, which installs the environment of the checks."""

import runpy
from pathlib import Path

ROOT = Path(__file__).parents[1]

settings_for_uv = runpy.run_path(str(ROOT / "requirements" / "install.py"))["settings_for_uv"]


def test_index_folders_certificates_and_time_outs_are_passed_on(tmp_path):
    found = settings_for_uv(
        {
            "PIP_CONFIG_FILE": str(tmp_path / "none"),
            "PIP_INDEX_URL": "https://a.example/simple",
            "PIP_EXTRA_INDEX_URL": "https://b.example/x https://c.example/y",
            "PIP_FIND_LINKS": "/one /two",
            "PIP_CERT": "/ca.pem",
            "PIP_TIMEOUT": "5",
            "PIP_TRUSTED_HOST": "a.example",
            "PIP_QUIET": "1",
        }
    )
    assert found == {
        "UV_DEFAULT_INDEX": "https://a.example/simple",
        "UV_INDEX": "https://b.example/x https://c.example/y",
        "UV_FIND_LINKS": "/one,/two",
        "SSL_CERT_FILE": "/ca.pem",
        "UV_HTTP_TIMEOUT": "5",
        "UV_INSECURE_HOST": "a.example",
    }


def test_environment_goes_before_files(tmp_path):
    (tmp_path / "pip.conf").write_text("[global]\nindex-url = https://a.example\ntimeout = 7\n", encoding="utf-8")
    found = settings_for_uv({"PIP_CONFIG_FILE": str(tmp_path / "pip.conf"), "PIP_INDEX_URL": "https://b.example"})
    assert found["UV_DEFAULT_INDEX"] == "https://b.example"
    assert found["UV_HTTP_TIMEOUT"] == "7"


def test_pip_installs_where_only_it_has_what_is_set(tmp_path):
    assert (
        settings_for_uv({"PIP_CONFIG_FILE": str(tmp_path / "none"), "PIP_PROXY": "http://proxy.example:3128"}) is None
    )
