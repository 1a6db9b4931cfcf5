//! Files of a few lines: a subject is in one file, so that a reader need not open several.

mod source;

use std::fs;

use source::{name_of, rust_files};

/// Shorter files need a reason.
const MIN_LINES: usize = 40;

/// Files that stay short: path and reason.
const SHORT_FILES: &[(&str, &str)] = &[
    ("python/src/command.rs", "the binding of one room, as its siblings"),
    ("src/bin/jacoflow.rs", "entry point of the binary"),
    ("src/filter/particle/update.rs", "one step of the cycle, as its siblings"),
    ("src/flow/model/accelerating.rs", "one motion model, as its siblings"),
    ("src/flow/model/translational.rs", "one motion model, as its siblings"),
    ("src/image/picture/disparity.rs", "one picture, as its siblings"),
    ("src/io/limits.rs", "limits of every reader"),
    ("src/io/source/glob.rs", "one kind of source, as its siblings"),
    ("src/math/special.rs", "a public module"),
    ("src/segment/options.rs", "options of a room, as in every room"),
    ("src/synth/motion/shear.rs", "one motion, as its siblings"),
    ("src/track/gradient/noise.rs", "statistics that detection and both trackers use"),
];

/// What is wrong with files, path and number of lines each, when those of `listed` may be short.
fn mistakes(files: &[(String, usize)], listed: &[(&str, &str)]) -> Vec<String> {
    let is_exempt =
        |path: &str| ["mod.rs", "lib.rs", "tests.rs"].iter().any(|name| path.ends_with(&format!("/{name}")));
    let is_short = |path: &str, lines: usize| lines < MIN_LINES && !is_exempt(path);
    let unlisted =
        files.iter().filter(|(path, lines)| is_short(path, *lines) && !listed.iter().any(|(kept, _)| kept == path));
    let short = unlisted.map(|(path, lines)| {
        format!("{path}: expected at least {MIN_LINES} lines, got {lines}; merge it into the file of its subject")
    });
    let outdated =
        listed.iter().filter(|(kept, _)| !files.iter().any(|(path, lines)| path == kept && is_short(path, *lines)));
    short.chain(outdated.map(|(kept, _)| format!("{kept}: no short file; remove it from the list"))).collect()
}

#[test]
fn short_files_have_a_reason() {
    let lines = |file| fs::read_to_string(file).unwrap().lines().count();
    let files: Vec<(String, usize)> = rust_files().iter().map(|file| (name_of(file), lines(file))).collect();
    let wrong = mistakes(&files, SHORT_FILES);
    assert!(wrong.is_empty(), "files below {MIN_LINES} lines:\n{}", wrong.join("\n"));
    assert!(SHORT_FILES.iter().all(|(_, reason)| !reason.is_empty()));
}

#[test]
fn unlisted_short_files_and_outdated_entries_are_found() {
    let files = [("src/a.rs", 39), ("src/b.rs", 39), ("src/c.rs", 40), ("src/d/mod.rs", 3), ("src/d/tests.rs", 3)]
        .map(|(path, lines)| (path.to_string(), lines));
    assert!(mistakes(&files, &[("src/a.rs", "reason"), ("src/b.rs", "reason")]).is_empty());
    let found = mistakes(&files, &[("src/b.rs", "reason"), ("src/c.rs", "long"), ("src/gone.rs", "missing")]);
    let named: Vec<&str> = found.iter().filter_map(|text| text.split(':').next()).collect();
    assert_eq!(named, ["src/a.rs", "src/c.rs", "src/gone.rs"]);
}
