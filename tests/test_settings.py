"""Settings of files are defaults: the command line wins, a project's over the user's, and each mistake has its line."""

import json
import os

import pytest
from buses import LINE, adu, spaced
from running import ran, refused, spawned

import captures
from analyzer import settingfiles
from captures import samples

TROUBLED = samples.path("troubled.jsonl")


@pytest.fixture
def files(tmp_path, monkeypatch):
    """Write the user's file and the project's; the working folder is below the project."""
    monkeypatch.setenv("RTUSCOPE_CONFIG", str(tmp_path / "config.toml"))
    below = tmp_path / "project" / "below"
    below.mkdir(parents=True)
    monkeypatch.chdir(below)

    def write(user="", project=None):
        (tmp_path / "config.toml").write_text(user, encoding="utf-8")
        if project is not None:
            (tmp_path / "project" / "rtuscope.toml").write_text(project, encoding="utf-8")
        return tmp_path

    return write


def test_each_value_says_where_it_is_from(capsys, files):
    at = files('port = "/dev/ttyS9"\n\n[line]\nbaud = 9600\nparity = "E"\n', "[line]\n# ours\nbaud = 19200\n")
    shown = ran(capsys, "config", "show").out
    assert f"19200  from {at / 'project' / 'rtuscope.toml'}, line 3" in shown
    assert f"E  from {at / 'config.toml'}, line 5" in shown
    assert f"/dev/ttyS9  from {at / 'config.toml'}, line 1" in shown
    assert json.loads(ran(capsys, "config", "show", "--json").out)["line.baud"]["value"] == 19200


def test_a_port_and_its_line_need_not_be_named(capsys, files):
    files('port = "/dev/nowhere"\n[line]\nbaud = 9600\n')
    assert "/dev/nowhere" in refused(capsys, "sniff")
    assert "/dev/elsewhere" in refused(capsys, "sniff", "/dev/elsewhere")
    files("[line]\nbaud = 9600\n")
    assert "required: PORT" in refused(capsys, "sniff")


def test_a_line_set_for_taps_does_not_speak_for_captures(capsys, files):
    files()
    before = ran(capsys, "report", TROUBLED, "--json").out
    files("[line]\nbaud = 300\n")
    assert ran(capsys, "report", TROUBLED, "--json").out == before


def test_the_command_line_wins(capsys, files):
    files("[timing]\nt35_ms = 99999\n")
    assert "t35_ms: '99999' is not between" in refused(capsys, "report", TROUBLED)
    files("[timing]\nt15_ms = 9\nt35_ms = 8\n")
    assert "longer than" in refused(capsys, "report", TROUBLED)
    assert ran(capsys, "report", TROUBLED, "--t35-ms", "10").status == 0


def test_maps_by_unit_from_the_folder_of_the_file(files):
    at = files(project='[maps]\n17 = "meter.csv"\n')
    (at / "project" / "meter.csv").write_text("area,address,name,type,unit\nholding,107,Active power,u16,W\n")
    (at / "other.csv").write_text("area,address,name,type,unit\nholding,107,Other,u16,W\n")
    captures.write("bus.jsonl", spaced([adu("1103006b0001"), adu("1103020064")]), line=LINE)
    show = ("replay", "bus.jsonl", "--speed", "max")
    assert "Active power 100 W" in spawned(*show, RTUSCOPE_CONFIG=str(at / "config.toml")).out
    given = spawned(*show, "--map", f"{at / 'other.csv'}@17", RTUSCOPE_CONFIG=str(at / "config.toml")).out
    assert "Other 100 W" in given
    assert "Active power" not in given


def test_a_map_of_a_home_that_nobody_has_is_one_line(capsys, files):
    files('[maps]\n17 = "~nobody-has-this-name/map.csv"\n')
    assert "defect" not in refused(capsys, "report", TROUBLED)


def test_filters_by_name(capsys, files):
    files('[filters]\ntrouble = "not crc_ok"\n')
    plain = ran(capsys, "export", TROUBLED, "--filter", "not crc_ok").out
    assert ran(capsys, "export", TROUBLED, "--filter", "@trouble").out == plain != ""
    assert "did you mean trouble?" in refused(capsys, "export", TROUBLED, "--filter", "@truoble")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("\n[line]\nbuad = 9600\n", "line 3: no setting 'line.buad': did you mean line.baud?"),
        ("port = 7\n", "line 1: port is 7"),
        ("theme = 'blue'\n", "line 1: theme is 'blue': use light or dark"),
        ("[maps]\n17 = 3\n", "line 2: maps.17 is not text"),
        ("[colours]\npink = 'exception'\n", "line 2: no colour 'pink': red, yellow, green, blue, violet"),
        ("[colours]\nred = 3\n", "line 2: colours.red is not text"),
        ("port = \n", "(at line 1, column 8)"),
        ("[line]\nbaud = true\n", "line 2: line.baud is True"),
        ("line = 9600\n", "line 1: no setting 'line'"),
        ("line = " + "[" * 5000, "nested too deeply"),
    ],
)
def test_mistakes_name_their_line(capsys, files, text, said):
    at = files(text)
    message = refused(capsys, "report", TROUBLED)
    assert message.startswith(str(at / "config.toml"))
    assert said in message
    assert ran(capsys, "config", "path").status == 0
    assert ran(capsys, "help").status == 0


@pytest.mark.parametrize(
    ("text", "command", "said"),
    [
        (
            '[line]\nbaud = "x"\n',
            ("sniff", "/dev/nowhere"),
            "line 2: line.baud: 'x' is not a rate in bit/s, settings such as 19200-8N1, or auto",
        ),
        ('[line]\nbaud = "19200-8N1"\n', ("sniff", "/dev/nowhere"), "line 2: line.baud: give only the rate"),
        ("[line]\nbaud = 0\n", ("sniff", "/dev/nowhere"), "line 2: line.baud: '0' is not a rate"),
        ("tz = 'Europe/Mosow'\n", ("report", TROUBLED), "line 1: tz: no time zone 'Europe/Mosow': did you mean"),
        ("lang = 'fr'\n", ("report", TROUBLED), "line 1: lang: invalid choice: 'fr'"),
        ("[timing]\nt15_ms = -4\n", ("report", TROUBLED), "line 2: timing.t15_ms: "),
        ("[maps]\n17 = 'estron-sdm630'\n", ("export", TROUBLED), "line 2: maps.17: estron-sdm630: no such file"),
        ("[filters]\nbad = 'unti == 17'\n", ("export", TROUBLED, "--filter", "@bad"), "line 2: filters.bad: "),
        ("[colours]\nred = 'exceptio'\n", (), "line 2: colours.red: "),
    ],
)
def test_values_that_cannot_be_name_their_line(capsys, files, text, command, said):
    at = files(text)
    for words in filter(None, (command, ("config", "show"))):
        message = refused(capsys, *words)
        assert message.startswith(str(at / "config.toml")) and said in message


def test_a_folder_that_is_entered_runs_nothing(capsys, files):
    files(project='functions = ["evil.py"]\n')
    assert "a project's file cannot set" in refused(capsys, "report", TROUBLED)
    at = files('functions = ["mine.py"]\n', "")
    (at / "mine.py").write_text("raise SystemExit('it ran')\n")
    assert "it ran" in refused(capsys, "report", TROUBLED)


def test_a_parity_that_is_none_is_told_by_the_argument_s_own_rule(capsys, files):
    files('[line]\nparity = "X"\n')
    assert "line.parity: invalid choice: 'X'" in refused(capsys, "sniff", "/dev/nowhere")


@pytest.mark.skipif(os.name != "posix", reason="where the file is on Linux")
def test_the_users_file_is_where_platformdirs_has_it(monkeypatch):
    platformdirs = pytest.importorskip("platformdirs")
    for base in ("", "/somewhere"):
        monkeypatch.setenv("XDG_CONFIG_HOME", base)
        assert settingfiles.user_file() == str(
            platformdirs.user_config_path("rtuscope", appauthor=False) / "config.toml"
        )


def test_words_that_are_nearly_right(capsys):
    assert "did you mean --speed?" in refused(capsys, "replay", TROUBLED, "--sped", "1")
    assert "did you mean zsh?" in refused(capsys, "completion", "zhs")
    assert "did you mean filters?" in refused(capsys, "help", "filtres")
    assert "did you mean report?" in refused(capsys, "reprot", TROUBLED)


@pytest.mark.parametrize(
    "port",
    [
        "socket://192.0.2.1:4001", "rfc2217://192.0.2.1:2217", "tap://192.0.2.1", "taps://x", "SOCKET://x:1",
        "spy:///dev/x",
        "loop://", "hwgrep://.", "alt:///dev/x", "//server/share", "\\\\server\\pipe\\x", "/dev/../etc/passwd",
        "notes.txt", "/etc/passwd", "",
    ],
)  # fmt: skip
def test_a_project_s_file_names_no_port_elsewhere(capsys, files, port):
    """A stranger's archive that is entered, or what anybody put into /tmp, must not choose whom one talks to."""
    at = files(project=f"port = {json.dumps(port)}\n")
    told = refused(capsys, "sniff")
    assert f"{at / 'project' / 'rtuscope.toml'}, line 1: port" in told and "a project's file cannot set" in told
    files(f"port = {json.dumps(port)}\n", "")
    assert "a project's file cannot set" not in refused(capsys, "sniff", "--duration", "1s", "--baud", "x")


@pytest.mark.parametrize(
    "port", ["/dev/ttyUSB0", "/dev/serial/by-id/usb-FTDI_FT232R-if00-port0", "COM7", "/dev/nowhere"]
)
def test_a_project_s_file_may_name_a_port_of_this_machine(capsys, files, port):
    files(project=f'port = "{port}"\n')
    assert f"{port}  from" in ran(capsys, "config", "show").out


@pytest.mark.parametrize(
    "name", ["/etc/passwd", "../elsewhere.csv", "~/secret.csv", "//server/share/m.csv", "C:\\m.csv", "link.csv"]
)
def test_a_project_s_file_names_no_map_outside_of_its_folder(capsys, files, tmp_path, name):
    at = files(project=f"[maps]\nall = {json.dumps(name)}\n")
    (tmp_path / "elsewhere.csv").write_text("address,name\n1,x\n")
    if os.name == "posix":
        (at / "project" / "link.csv").symlink_to(tmp_path / "elsewhere.csv")
    elif name == "link.csv":
        pytest.skip("links need rights on Windows")
    told = refused(capsys, "report", TROUBLED)
    assert "line 2: the map" in told and "outside the project's folder" in told
