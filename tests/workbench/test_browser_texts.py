"""The texts of the workbench in a browser: keys, files, fixes, and the tab of checks."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("selenium", reason="selenium is not installed")

from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.keys import Keys

from workbench.conftest import MODEL, PROPERTIES, Workbench

CHAIN = """ctmc
module m
  x : [0..2] init 0;
  safe : bool init true;
  [] x<2 -> 2 : (x'=x+1);
  [] x=2 -> 1 : (x'=0) & (safe'=false);
endmodule
"""
QUESTIONS = """P<=0.5 [ F<=1 x=2 ];
P>=0.9 [ F<=1 x=2 ];
E [ F x=2 ];
A [ G x<2 ];
"""


def given(bench: Workbench, n: str) -> None:
    bench.fill("#constants input[name=N]", n)


def write(bench: Workbench, part: str, text: str) -> None:
    """Another text in place of the one that is there, as if it was pasted.

    The keys go to the editor when it has the focus, and the text is there when this returns.
    """
    bench.at(f"{part}-tab").click()
    bench.all(f"#{part} .cm-content")[0].click()
    focus = f"return document.activeElement === document.querySelector('#{part} .cm-content')"
    bench.until(lambda: bench.run(focus))
    bench.with_control("a")
    bench.browser.execute_cdp_cmd("Input.insertText", {"text": text})
    bench.until(lambda: shown(bench, part).split() == text.split())


def press(bench: Workbench, *keys: str) -> None:
    """Press the last key while the others are held."""
    chain = ActionChains(bench.browser)
    for key in keys[:-1]:
        chain = chain.key_down(key)
    chain = chain.send_keys(keys[-1])
    for key in reversed(keys[:-1]):
        chain = chain.key_up(key)
    chain.perform()


def shown(bench: Workbench, part: str = "model") -> str:
    """The text in an editor."""
    return "\n".join(e.get_property("textContent") for e in bench.all(f"#{part} .cm-line"))


def answer(bench: Workbench, text: str | None = None) -> str:
    """Agree to what a dialog asks, with a text; what it asks."""
    from selenium.webdriver.support.expected_conditions import alert_is_present

    bench.until(lambda: alert_is_present()(bench.browser))
    dialog = bench.browser.switch_to.alert
    asked = str(dialog.text)
    if text is not None:
        dialog.send_keys(text)
    dialog.accept()
    return asked


def names(bench: Workbench, part: str = "model") -> list[str]:
    return [e.get_property("value") for e in bench.all(f"#{part}-file option")]


# --------------------------------------------------------------------------------------------- keys


def test_f5_checks_everything_and_does_not_reload_the_page(bench: Workbench) -> None:
    given(bench, "4")
    bench.run("window.isTheSame = true")
    bench.at("log-tab").click()
    press(bench, Keys.F5)
    bench.until(lambda: len(bench.values) == 2)
    assert bench.run("return window.isTheSame")
    assert "F5" in bench.at("check-all").get_attribute("title")


def test_control_and_enter_checks_what_stands_at_the_cursor(bench: Workbench) -> None:
    given(bench, "4")
    write(bench, "properties", PROPERTIES + "// the last line\n")
    press(bench, Keys.CONTROL, Keys.ENTER)  # the second one is the last before the cursor
    bench.until(lambda: bench.values == ["✗ false"])
    press(bench, Keys.CONTROL, Keys.HOME)
    press(bench, Keys.CONTROL, Keys.ENTER)
    bench.until(lambda: len(bench.values) == 2)
    assert shown(bench, "properties") == PROPERTIES + "// the last line\n"


def test_control_and_enter_in_the_model_checks_everything(bench: Workbench) -> None:
    given(bench, "4")
    bench.type_at_end("// one more line")
    press(bench, Keys.CONTROL, Keys.ENTER)
    bench.until(lambda: len(bench.values) == 2)


def test_a_faulty_property_shows_its_fault_beside_the_values_of_the_others(
    bench: Workbench,
) -> None:
    given(bench, "4")
    write(bench, "properties", "P>0 [ F x= ];\n" + PROPERTIES)
    bench.until(lambda: len(bench.all("#list li pre.bad")) == 1)
    assert "unexpected ']'" in bench.all("#list li:first-child pre.bad")[0].text
    assert bench.all("#list li:first-child button:not(.link)") == []
    press(bench, Keys.F5)
    bench.until(lambda: len(bench.values) == 2)
    assert not bench.at("trouble").is_displayed()


def test_properties_of_an_earlier_text_are_not_checked(bench: Workbench) -> None:
    """A text that is a model is none of properties."""
    given(bench, "4")
    write(bench, "properties", MODEL)
    bench.until(lambda: "properties:" in bench.at("state").text)
    bench.until(lambda: not any(b.is_enabled() for b in bench.all("#list button:not(.link)")))
    press(bench, Keys.F5)
    bench.until(lambda: bench.at("trouble").is_displayed())
    assert bench.at("state").text in bench.at("trouble").text.replace("\n", " ")
    assert bench.values == []


# ----------------------------------------------------------------------------------- checks, samples


def test_an_estimate_stands_beside_what_was_checked(bench: Workbench) -> None:
    write(bench, "properties", "P=? [ F x=1 ];")
    write(bench, "model", "dtmc module m x:[0..2]; [] x=0 -> 0.25:(x'=1)+0.75:(x'=2); endmodule")
    bench.click("check-all")
    bench.until(lambda: bench.values == ["0.25"])
    bench.click("estimate-all")
    bench.until(lambda: len(bench.values) == 2)
    assert bench.values[0] == "0.25"


def test_the_buttons_stay_where_they_are_when_fields_of_constants_go(bench: Workbench) -> None:
    """A button that moves between the press and the release of the mouse is not clicked."""
    before = bench.at("check-all").location
    write(bench, "properties", "P=? [ F x=1 ];")
    write(bench, "model", "dtmc module m x:[0..2]; [] x=0 -> 0.25:(x'=1)+0.75:(x'=2); endmodule")
    bench.until(lambda: not bench.all("#constants input"))
    assert bench.at("check-all").location == before


def test_an_estimate_says_that_it_is_sampled_with_its_interval(bench: Workbench) -> None:
    write(bench, "properties", "P=? [ F x=1 ];")
    write(bench, "model", "dtmc module m x:[0..2]; [] x=0 -> 0.25:(x'=1)+0.75:(x'=2); endmodule")
    bench.until(lambda: "3 reachable" in bench.at("state").text)
    bench.run("arguments[0].open = true", bench.at("sampling"))
    bench.fill("#sampling [name=samples]", "4000")
    bench.fill("#sampling [name=error]", "0.05")
    bench.fill("#sampling [name=seed]", "7")
    bench.press("Estimate")
    about = bench.until(lambda: bench.all("#list .of")[0].text)
    assert about.startswith("sampled: in [0.2")
    assert "with probability 0.95, 4000 samples" in about
    assert "seed 7" in about
    assert float(bench.values[0]) == pytest.approx(0.25, abs=0.03)
    bench.fill("#sampling [name=samples]", "many")
    bench.click("estimate-all")
    bench.until(lambda: "samples: 'many' is not a number" in bench.at("list").text)


def test_an_estimate_tells_its_progress_and_is_cancelled(bench: Workbench) -> None:
    bench.choose("model-file", "grid.pm")
    bench.until(lambda: bench.at("properties-tab").text == "grid.props")
    write(bench, "properties", "P=? [ F<=9000 x=0 & y=0 ];")
    bench.until(lambda: "F<=9000" in bench.at("list").text)
    bench.run("arguments[0].open = true", bench.at("sampling"))
    bench.fill("#sampling [name=samples]", "100000000")
    bench.press("Estimate")
    bench.until(lambda: "of 100,000,000 samples" in bench.all("#progress output")[0].text)
    bench.press("Cancel")
    bench.until(lambda: "cancelled" in bench.at("list").text)


def test_distributions_list_the_likeliest_states_first(bench: Workbench) -> None:
    bench.choose("properties-file", "")
    bench.until(lambda: bench.at("properties-tab").text == "properties")
    write(bench, "model", CHAIN)
    bench.until(lambda: "6 reachable" in bench.at("state").text)
    bench.run("arguments[0].open = true", bench.at("distribution"))
    bench.click("steady-state")

    def rows() -> list[list[str]]:
        return [e.text.split() for e in bench.all("#distribution-table tr")]

    head, *states = bench.until(rows)
    assert head == ["x", "safe", "probability"]
    assert [row[:2] for row in states] == [["2", "false"], ["0", "false"], ["1", "false"]]
    assert [float(row[2]) for row in states] == pytest.approx([0.5, 0.25, 0.25])
    bench.fill("#time", "0")
    bench.click("transient")
    bench.until(lambda: rows()[1:] == [["0", "true", "1.0"]])
    assert "1 of 6 states" in bench.at("distribution-about").text
    bench.click("distribution-csv")
    head_line, *lines = bench.downloaded("distribution.csv").decode().splitlines()
    assert head_line == "state,x,safe,probability"
    assert len(lines) == 6
    bench.fill("#time", "soon")
    bench.click("transient")
    assert "'soon' is not a time" in bench.at("trouble").text
    bench.type_at_end("// another text")
    bench.until(lambda: not rows())


def test_why_is_offered_where_there_is_an_answer(bench: Workbench) -> None:
    write(bench, "properties", QUESTIONS)
    write(bench, "model", CHAIN)
    bench.until(lambda: "6 reachable" in bench.at("state").text)
    bench.until(lambda: len(bench.all("#list li")) == 4)
    bench.click("check-all")
    bench.until(lambda: len(bench.values) == 4)
    assert bench.values == ["✗ false", "✗ false", "✓ true", "✗ false"]
    offered = ["Why?" in e.text for e in bench.all("#list li")]
    assert offered == [True, False, True, True]  # no paths show that P>=p [ F<=t ] is false
    bench.all("#list li")[2].find_element("xpath", ".//button[.='Why?']").click()
    bench.until(lambda: bench.at("graph-text").text)
    assert bench.at("graph-text").text.splitlines() == [
        "0: x=0, safe=true",
        "1: x=1, safe=true",
        "2: x=2, safe=true",
    ]


def test_an_error_is_gone_when_its_text_has_changed(bench: Workbench) -> None:
    given(bench, "4")
    bench.at("graph-tab").click()
    bench.fill("#around", "xx=2")
    bench.click("draw-near")
    bench.until(lambda: "did you mean x?" in bench.at("trouble").text)
    write(bench, "properties", "P=? [ F x=1 ];")
    bench.until(lambda: not bench.at("trouble").is_displayed())
    bench.at("check-tab").click()
    bench.until(lambda: len(bench.all("#list li")) == 1)
    bench.click("check-all")
    bench.until(lambda: "Pmin=?" in bench.all("#list .bad")[0].text)
    write(bench, "properties", "Pmin=? [ F x=2 ];")
    bench.until(lambda: not bench.all("#list .bad"))


# -------------------------------------------------------------------------------------------- files


def test_a_file_is_saved_under_another_name(bench: Workbench, folder: Path) -> None:
    bench.type_at_end("// mine")
    bench.at("save-as").click()
    answer(bench, "other.nm")
    bench.until(lambda: bench.at("model-tab").text == "other.nm")
    assert (folder / "other.nm").read_text() == MODEL + "// mine"
    assert (folder / "walk.nm").read_text() == MODEL
    bench.until(lambda: "other.nm" in names(bench))
    bench.at("save-as").click()
    answer(bench, "grid.pm")
    assert answer(bench) == "grid.pm exists. Replace it?"
    bench.until(lambda: bench.at("model-tab").text == "grid.pm")
    assert (folder / "grid.pm").read_text() == MODEL + "// mine"


def test_a_file_is_renamed_with_what_is_not_saved(bench: Workbench, folder: Path) -> None:
    bench.type_at_end("// mine")
    bench.at("rename").click()
    answer(bench, "grid.pm")
    bench.until(lambda: "'grid.pm' exists already" in bench.at("trouble").text)
    bench.at("rename").click()
    answer(bench, "new")
    bench.until(lambda: bench.at("model-tab").text == "● new.nm")
    assert not (folder / "walk.nm").exists()
    assert (folder / "new.nm").read_text() == MODEL
    bench.browser.refresh()
    bench.until(lambda: bench.at("model-tab").text == "● new.nm")
    assert "// mine" in shown(bench)


def test_a_file_is_deleted_after_a_question(bench: Workbench, folder: Path) -> None:
    bench.at("properties-tab").click()
    bench.at("delete").click()
    bench.browser.switch_to.alert.dismiss()
    assert (folder / "walk.props").exists()
    bench.at("delete").click()
    assert answer(bench) == "Delete walk.props?"
    bench.until(lambda: bench.at("properties-tab").text == "properties")
    assert not (folder / "walk.props").exists()
    bench.until(lambda: "walk.props" not in names(bench, "properties"))
    assert not bench.at("delete").is_enabled()


def test_the_names_follow_the_folder(bench: Workbench, folder: Path) -> None:
    (folder / "new.nm").write_text(MODEL)
    bench.until(lambda: "new.nm" in names(bench))
    (folder / "new.nm").unlink()
    bench.until(lambda: "new.nm" not in names(bench))


def test_the_text_of_a_file_that_is_deleted_outside_stays(bench: Workbench, folder: Path) -> None:
    (folder / "walk.nm").unlink()
    bench.until(lambda: bench.at("model-tab").text == "● walk.nm")
    assert "was deleted on disk" in bench.at("trouble").text
    assert shown(bench) == MODEL
    bench.with_control("s")
    bench.until(lambda: bench.at("model-tab").text == "walk.nm")
    assert (folder / "walk.nm").read_text() == MODEL
    assert not bench.at("trouble").is_displayed()
    (folder / "walk.nm").unlink()
    bench.until(lambda: bench.at("model-tab").text == "● walk.nm")
    (folder / "walk.nm").write_text("// theirs\n" + MODEL)
    bench.until(lambda: "// theirs" in shown(bench))
    assert not bench.at("trouble").is_displayed()
    assert not bench.at("conflict").is_displayed()


# -------------------------------------------------------------------------------------------- texts


def test_a_fault_is_put_right_by_its_fix(bench: Workbench) -> None:
    bench.type_at_end('label "far" = los;')
    word = bench.until(lambda: bench.all("#model .cm-lintRange-error")[0])
    ActionChains(bench.browser).move_to_element(word).perform()
    bench.until(lambda: bench.named(".cm-diagnosticAction", "Change to 'lost'")[0].click() or True)
    bench.until(lambda: not bench.all("#model .cm-lintRange-error"))
    assert 'label "far" = lost;' in shown(bench)


def test_a_text_is_formatted_and_taken_back(bench: Workbench) -> None:
    ragged = MODEL.replace("  ", "     ")
    write(bench, "model", ragged)
    press(bench, Keys.SHIFT, Keys.ALT, "f")
    bench.until(lambda: shown(bench) == MODEL)
    bench.with_control("z")
    bench.until(lambda: shown(bench) == ragged)
    bench.at("format").click()
    bench.until(lambda: shown(bench) == MODEL)


def test_the_end_of_a_block_is_outdented_while_it_is_typed(bench: Workbench) -> None:
    write(bench, "model", "pta\n")
    lines = [
        *("module m", "x : clock;", "invariant", "x<=1", "endinvariant", "[] x>0 -> true;"),
        *("endmodule", "rewards", "true : 1;", "endrewards"),
    ]
    for line in lines:
        press(bench, line)
        press(bench, Keys.ESCAPE)  # no completion
        press(bench, Keys.ENTER)
    assert shown(bench).splitlines() == [
        "pta",
        "module m",
        "  x : clock;",
        "  invariant",
        "    x<=1",
        "  endinvariant",
        "  [] x>0 -> true;",
        "endmodule",
        "rewards",
        "  true : 1;",
        "endrewards",
    ]


def test_an_empty_model_is_a_beginning(bench: Workbench) -> None:
    bench.choose("model-file", "")
    bench.until(lambda: "There is no model yet" in bench.at("state").text)
    assert not bench.all("#model .cm-lintRange-error")
    assert "bad" not in bench.at("state").get_attribute("class")
    assert "module coin" in bench.all("#model .cm-placeholder")[0].text
