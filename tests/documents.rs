//! What the book says is true: its JSON is accepted, its links lead somewhere.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;
use tombolo_deform::surface::Edit;
use tombolo_pipelines::language::{LanguageError, parse, parse_json, parse_orders};
use tombolo_tests::project;

fn pages() -> Vec<PathBuf> {
    let mut pages: Vec<PathBuf> = fs::read_dir(project().join("docs"))
        .expect("docs/ is there")
        .map(|entry| entry.expect("docs/ can be read").path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "md"))
        .collect();
    pages.extend(["README.md", "CONTRIBUTING.md", "CHANGELOG.md"].map(|page| project().join(page)));
    pages.sort();
    pages
}

/// The fenced blocks of a language, with the line each starts at.
fn blocks(text: &str, language: &str) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    let mut current: Option<(usize, bool, String)> = None;
    for (number, line) in text.lines().enumerate() {
        match (&mut current, line.trim_start().strip_prefix("```")) {
            (None, Some(name)) => current = Some((number + 2, name == language, String::new())),
            (Some(_), Some(_)) => {
                if let Some((start, true, block)) = current.take() {
                    found.push((start, block));
                }
            }
            (Some((_, _, block)), None) => {
                block.push_str(line);
                block.push('\n');
            }
            (None, None) => {}
        }
    }
    found
}

/// Reads a snippet as what it looks like: a configuration, a list of edits, or commands as viewers and files of orders say them.
fn accept(block: &str, name: &str) -> Result<(), LanguageError> {
    let value: Value = parse_json(block, name)?;
    let first = value.get(0).unwrap_or(&value);
    if value.get("version").is_some() {
        return parse(block, name).map(drop);
    }
    if first.get("order").is_none() && value.is_array() {
        return parse_json::<Vec<Edit>>(block, name).map(drop);
    }
    parse_orders(block, name).map(drop)
}

#[test]
fn json_of_the_book_is_accepted() {
    let mut checked = 0;
    for page in pages() {
        let text = fs::read_to_string(&page).expect("a page can be read");
        for (line, block) in blocks(&text, "json") {
            if let Err(error) = accept(&block, "snippet") {
                panic!("{}:{line}: {error}", page.display());
            }
            checked += 1;
        }
    }
    assert!(checked > 0, "the book has no JSON");
}

#[test]
fn what_is_wrong_in_a_snippet_is_found() {
    for wrong in
        [r#"{"version": 1, "pipelnes": []}"#, r#"[{"translate": {"by": [1, 0]}}]"#, r#"[{"order": {"undo": "all"}}]"#]
    {
        assert!(accept(wrong, "snippet").is_err(), "{wrong}");
    }
}

#[test]
fn links_of_the_book_lead_somewhere() {
    for page in pages() {
        let text = fs::read_to_string(&page).expect("a page can be read");
        for target in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            if target.starts_with("http") || target.starts_with('#') || target.contains(' ') {
                continue;
            }
            let file = target.split('#').next().unwrap_or(target);
            let path = page.parent().unwrap_or(Path::new(".")).join(file);
            assert!(path.exists(), "{}: '{target}' leads nowhere", page.display());
        }
    }
}
