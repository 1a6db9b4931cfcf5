//! The one direction of imports: a module imports only from lower levels, never from a sibling.
//!
//! Reads every `crate::` path in `src/`; the table is that of `ARCHITECTURE.md`.

use std::fs;
use std::path::{Path, PathBuf};

/// Folder (or file) under `src/` and its level.
const LEVELS: &[(&str, u8)] = &[
    ("ablation", 0),
    ("error", 0),
    ("types", 0),
    ("math", 0),
    ("parallel", 0),
    ("simd", 0),
    ("image", 1),
    ("jet", 2),
    ("io", 2),
    ("synth", 2),
    ("flow", 3),
    ("filter", 3),
    ("mixture", 3),
    ("motion3d", 3),
    ("segment", 3),
    ("stereo", 3),
    ("temporal", 4),
    ("track", 4),
    ("pipeline", 5),
    ("cli", 6),
    ("python", 6),
];

/// Level 0 is ordered too: each may use only those before it.
const FOUNDATION: &[&str] = &["ablation", "error", "math", "simd", "parallel", "types"];

fn level(room: &str) -> Option<u8> {
    LEVELS.iter().find(|(name, _)| *name == room).map(|(_, level)| *level)
}

fn rust_files(folder: &Path, into: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            rust_files(&path, into);
        } else if path.extension().is_some_and(|e| e == "rs") {
            into.push(path);
        }
    }
}

/// The rooms named by `crate::room` or inside `crate::{...}` in a source text, comments left out.
fn imported_rooms(text: &str) -> Vec<String> {
    let code: String = text.lines().filter(|l| !l.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n");
    let mut rooms = Vec::new();
    for (at, _) in code.match_indices("crate::") {
        let rest = &code[at + "crate::".len()..];
        if let Some(group) = rest.strip_prefix('{') {
            let mut depth = 1;
            let mut word = String::new();
            let mut path_head = true;
            for c in group.chars() {
                match c {
                    '{' => depth += 1,
                    '}' => depth -= 1,
                    ',' if depth == 1 => path_head = true,
                    _ => {}
                }
                if c.is_alphanumeric() || c == '_' {
                    word.push(c);
                } else {
                    if !word.is_empty() && path_head {
                        rooms.push(word.clone());
                        path_head = c == ',';
                    }
                    word.clear();
                }
                if depth == 0 {
                    break;
                }
            }
        } else {
            rooms.push(rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect());
        }
    }
    rooms
}

fn allowed(from: &str, to: &str) -> bool {
    let (Some(a), Some(b)) = (level(from), level(to)) else { return true };
    if from == to || b < a {
        return true;
    }
    let place = |room: &str| FOUNDATION.iter().position(|f| *f == room);
    // The binding exposes the binary's entry point; nothing imports the binding.
    (a == 0 && b == 0 && place(to) < place(from)) || (from == "python" && to == "cli")
}

#[test]
fn imports_go_one_way() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    rust_files(&src, &mut files);
    let mut wrong = Vec::new();
    for file in &files {
        let inside = file.strip_prefix(&src).unwrap();
        let room = inside.components().next().unwrap().as_os_str().to_string_lossy().replace(".rs", "");
        if room == "lib" || room == "bin" {
            continue;
        }
        assert!(
            level(&room).is_some(),
            "{room}: a room without a level; add it to the table here and in ARCHITECTURE.md"
        );
        for to in imported_rooms(&fs::read_to_string(file).unwrap()) {
            if !allowed(&room, &to) {
                wrong.push(format!("{} imports {to}", inside.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "imports against the direction:\n{}", wrong.join("\n"));
}

#[test]
fn binding_and_argument_parser_stay_in_their_rooms() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    rust_files(&src, &mut files);
    for file in files {
        let inside = file.strip_prefix(&src).unwrap().to_path_buf();
        let text = fs::read_to_string(&file).unwrap();
        let outside = !["cli", "python"].iter().any(|room| inside.starts_with(room));
        for word in ["pyo3::", "clap::", "indicatif::"] {
            assert!(!(outside && text.contains(word)), "{} uses {word}", inside.display());
        }
    }
}

#[test]
fn the_reader_of_imports_sees_wrong_arrows() {
    assert_eq!(
        imported_rooms("use crate::flow::x;\nuse crate::{io, synth::{a, b}, types};"),
        ["flow", "io", "synth", "types"]
    );
    assert!(!allowed("image", "flow") && !allowed("io", "synth") && !allowed("error", "types"));
    assert!(allowed("flow", "jet") && allowed("types", "error") && allowed("jet", "jet"));
}
