//! The one direction of imports: a module imports only from lower levels, never from a sibling, and the files
//! of a room form no circles.
//!
//! Reads every path of a `use` or of an expression in the sources and `benchmarks/`; the table of levels is
//! that of `ARCHITECTURE.md`. A parent module and its children may name each other.

mod source;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use source::{SOURCES, files, name_of, root, rust_files};

/// Folder (or file) under `src/` and its level.
const LEVELS: &[(&str, u8)] = &[
    ("ablation", 0),
    ("buffer_pool", 0),
    ("error", 0),
    ("types", 0),
    ("math", 0),
    ("parallel", 0),
    ("simd", 0),
    ("image", 1),
    ("scattered", 1),
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
];

/// Level 0 is ordered too: each may use only those before it.
const FOUNDATION: &[&str] = &["ablation", "error", "math", "simd", "parallel", "buffer_pool", "types"];

fn level(room: &str) -> Option<u8> {
    LEVELS.iter().find(|(name, _)| *name == room).map(|(_, level)| *level)
}

fn is_allowed(from: &str, to: &str) -> bool {
    let (Some(a), Some(b)) = (level(from), level(to)) else { return true };
    if from == to || b < a {
        return true;
    }
    let place = |room: &str| FOUNDATION.iter().position(|f| *f == room);
    a == 0 && b == 0 && place(to) < place(from)
}

/// Source text without comments, strings' contents kept.
fn without_comments(text: &str) -> String {
    text.lines().map(|line| line.split("//").next().unwrap()).collect::<Vec<_>>().join("\n")
}

/// Source text up to its unit tests.
fn without_tests(text: &str) -> &str {
    let test = text.find("#[cfg(test)]\nmod ").unwrap_or(text.len());
    &text[..test]
}

/// Every path that begins with `crate`, `super` or `self`, or (after `use` or `pub use`) with any name;
/// groups in braces are taken apart.
fn paths(code: &str) -> Vec<Vec<String>> {
    let mut found = Vec::new();
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    for start in ["crate::", "super::", "self::"] {
        for (at, _) in code.match_indices(start) {
            let before = code[..at].chars().next_back();
            // `super::super::x` is read from its first `super`.
            if before.is_some_and(|c| is_word(c) || c == ':') {
                continue;
            }
            expand(&code[at..], &mut Vec::new(), &mut found);
        }
    }
    for (at, word) in code.match_indices("use ") {
        if code[..at].chars().next_back().is_none_or(char::is_whitespace) {
            let rest = &code[at + word.len()..];
            if !["crate::", "super::", "self::"].iter().any(|start| rest.starts_with(start)) {
                expand(rest, &mut Vec::new(), &mut found);
            }
        }
    }
    found
}

/// Reads one path tree such as `a::{b, c::d}` at the beginning of `text`; returns the bytes read.
fn expand(text: &str, prefix: &mut Vec<String>, found: &mut Vec<Vec<String>>) -> usize {
    let depth = prefix.len();
    let mut at = 0;
    loop {
        let rest = &text[at..];
        let word: String = rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
        at += word.len();
        if !word.is_empty() {
            prefix.push(word);
        }
        if text[at..].starts_with("::") {
            at += 2;
            if text[at..].starts_with('{') {
                at += 1;
                loop {
                    at += text[at..].len() - text[at..].trim_start_matches([' ', '\n', ',']).len();
                    if text[at..].starts_with('}') || at >= text.len() {
                        at += 1;
                        break;
                    }
                    let read = expand(&text[at..], prefix, found);
                    if read == 0 {
                        break;
                    }
                    at += read;
                    // A renaming (`as name`) does not matter here.
                    let skipped = text[at..].find([',', '}']).unwrap_or(0);
                    at += skipped;
                }
                break;
            }
        } else {
            found.push(prefix.clone());
            break;
        }
    }
    prefix.truncate(depth);
    at
}

/// The modules of a crate: path (`["flow", "model"]`) and text of its file, unit tests and comments left out.
struct Modules(BTreeMap<Vec<String>, (String, String)>);

impl Modules {
    fn read(src: &Path) -> Self {
        let mut modules = BTreeMap::new();
        for file in files(src, "rs") {
            let inside = file.strip_prefix(src).unwrap().with_extension("");
            let mut path: Vec<String> = inside.iter().map(|part| part.to_string_lossy().into_owned()).collect();
            if path[0] == "lib" || path[0] == "bin" || path.iter().any(|part| part == "tests") {
                continue;
            }
            if path.last().is_some_and(|last| last == "mod") {
                path.pop();
            }
            let text = fs::read_to_string(&file).unwrap();
            modules.insert(path, (name_of(&file), without_comments(without_tests(&text))));
        }
        Self(modules)
    }

    /// The module that a path written in module `from` leads to, through re-exports.
    fn resolve(&self, from: &[String], path: &[String], depth: usize) -> Option<Vec<String>> {
        let mut at: Vec<String> = from.to_vec();
        let mut rest = path;
        match path.first().map(String::as_str) {
            Some("crate") => {
                at.clear();
                rest = &rest[1..];
            }
            Some("self") => rest = &rest[1..],
            Some("super") => {
                while rest.first().is_some_and(|part| part == "super") {
                    at.pop();
                    rest = &rest[1..];
                }
            }
            // A child of this module, or a crate.
            Some(first) => {
                let child: Vec<String> = from.iter().cloned().chain([first.to_string()]).collect();
                if !self.0.contains_key(&child) {
                    return None;
                }
            }
            None => return None,
        }
        while let Some(part) = rest.first() {
            let child: Vec<String> = at.iter().cloned().chain([part.clone()]).collect();
            if !self.0.contains_key(&child) {
                break;
            }
            at = child;
            rest = &rest[1..];
        }
        let item = rest.first();
        let text = &self.0.get(&at)?.1;
        if let Some(item) = item.filter(|_| depth < 8) {
            // An item that this module only hands on.
            for (position, _) in text.match_indices("pub") {
                let statement = text[position..].split(';').next().unwrap();
                let Some((_, used)) = statement.split_once("use ") else { continue };
                if statement.contains(['=', '#']) {
                    continue;
                }
                let mut handed = Vec::new();
                expand(used, &mut Vec::new(), &mut handed);
                if let Some(origin) = handed.iter().find(|h| h.last() == Some(item)) {
                    return self.resolve(&at, origin, depth + 1).or(Some(at));
                }
            }
        }
        Some(at)
    }

    /// For each module the others of its room that it names, its parents and children left out.
    fn edges(&self) -> BTreeMap<Vec<String>, BTreeSet<Vec<String>>> {
        let mut edges = BTreeMap::new();
        for (from, (_, text)) in &self.0 {
            let named: BTreeSet<Vec<String>> = paths(text)
                .iter()
                .filter_map(|path| self.resolve(from, path, 0))
                .filter(|to| to.first() == from.first() && !to.starts_with(from) && !from.starts_with(to))
                .collect();
            edges.insert(from.clone(), named);
        }
        edges
    }
}

/// Groups of more than one node that reach each other.
fn circles<T: Ord + Clone>(edges: &BTreeMap<T, BTreeSet<T>>) -> Vec<Vec<T>> {
    let reach: BTreeMap<&T, BTreeSet<&T>> = edges
        .keys()
        .map(|start| {
            let (mut seen, mut open) = (BTreeSet::new(), vec![start]);
            while let Some(node) = open.pop() {
                for next in edges.get(node).into_iter().flatten() {
                    if seen.insert(next) {
                        open.push(next);
                    }
                }
            }
            (start, seen)
        })
        .collect();
    let mut found: BTreeSet<Vec<T>> = BTreeSet::new();
    for (node, reached) in &reach {
        if reached.contains(*node) {
            let group = reached.iter().filter(|other| reach.get(**other).is_some_and(|r| r.contains(*node)));
            found.insert(group.map(|other| (**other).clone()).collect());
        }
    }
    found.into_iter().collect()
}

#[test]
fn imports_go_one_way() {
    let src = root().join("src");
    let mut wrong = Vec::new();
    for file in files(&src, "rs") {
        let inside = file.strip_prefix(&src).unwrap();
        let room = inside.iter().next().unwrap().to_string_lossy().replace(".rs", "");
        if room == "lib" || room == "bin" {
            continue;
        }
        assert!(
            level(&room).is_some(),
            "{room}: a room without a level; add it to the table here and in ARCHITECTURE.md"
        );
        for path in paths(&without_comments(&fs::read_to_string(&file).unwrap())) {
            if let [start, to, ..] = &path[..]
                && start == "crate"
                && !is_allowed(&room, to)
            {
                wrong.push(format!("{} imports {to}", name_of(&file)));
            }
        }
    }
    assert!(wrong.is_empty(), "imports against the direction:\n{}", wrong.join("\n"));
}

#[test]
fn systems_name_every_folder_of_tests() {
    let tests = root().join("tests");
    let systems = fs::read_to_string(tests.join("systems.rs")).unwrap();
    let missing: Vec<String> = files(&tests, "rs")
        .iter()
        .filter_map(|file| file.strip_prefix(&tests).unwrap().parent()?.to_str().map(String::from))
        .filter(|folder| !folder.is_empty() && !folder.contains('/') && folder != "source")
        .filter(|folder| !systems.contains(&format!("\nmod {folder};\n")))
        .collect();
    assert!(
        missing.is_empty(),
        "tests/systems.rs: expected every folder beside it as a module, got none for {missing:?}"
    );
}

#[test]
fn files_of_a_room_form_no_circles() {
    let mut text = String::new();
    for folder in SOURCES {
        let edges = Modules::read(&root().join(folder)).edges();
        for circle in circles(&edges) {
            text += &format!("{} files in {folder}:\n", circle.len());
            for from in &circle {
                let to = edges[from].iter().filter(|to| circle.contains(to)).map(|to| to.join("/"));
                text += &format!("  {} -> {}\n", from.join("/"), to.collect::<Vec<_>>().join(", "));
            }
        }
    }
    assert!(text.is_empty(), "files that import each other in a circle:\n{text}");
}

#[test]
fn benchmarks_form_no_circles() {
    let folder = root().join("benchmarks");
    let mut modules: BTreeMap<String, String> = BTreeMap::new();
    for file in files(&folder, "py") {
        let inside = file.strip_prefix(&folder).unwrap().with_extension("");
        let path: Vec<String> = inside.iter().map(|part| part.to_string_lossy().into_owned()).collect();
        modules.insert(path.join("."), fs::read_to_string(&file).unwrap());
    }
    let mut edges: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for (name, text) in &modules {
        let package = name.rsplit_once('.').map_or("", |(package, _)| package);
        let mut named = BTreeSet::new();
        let mut take = |path: &str| {
            let absolute = path.strip_prefix("benchmarks.").unwrap_or(path);
            let inner = if package.is_empty() { absolute.to_string() } else { format!("{package}.{absolute}") };
            for candidate in [absolute, inner.as_str()] {
                if candidate != name && modules.contains_key(candidate) {
                    named.insert(candidate.to_string());
                }
            }
        };
        for line in text.lines().map(str::trim_start) {
            let words: Vec<&str> = line.split([' ', ',']).filter(|word| !word.is_empty()).collect();
            match words[..] {
                ["import", ..] => words[1..].iter().for_each(|word| take(word)),
                ["from", module, "import", ..] => {
                    let module = module.trim_start_matches('.');
                    take(module);
                    words[3..].iter().for_each(|word| take(&format!("{module}.{word}")));
                    words[3..]
                        .iter()
                        .filter(|_| module.is_empty() || module == "benchmarks")
                        .for_each(|word| take(word));
                }
                _ => {}
            }
        }
        edges.insert(name.clone(), named);
    }
    let found: Vec<String> = circles(&edges).iter().map(|circle| circle.join(", ")).collect();
    assert!(found.is_empty(), "benchmarks that import each other in a circle:\n{}", found.join("\n"));
}

#[test]
fn the_argument_parser_stays_in_its_room() {
    for file in rust_files() {
        let name = name_of(&file);
        let text = fs::read_to_string(&file).unwrap();
        for word in ["clap::", "indicatif::"] {
            assert!(name.starts_with("src/cli/") || !text.contains(word), "{name} uses {word}");
        }
    }
}

#[test]
fn only_parallel_names_rayon() {
    for file in rust_files() {
        let name = name_of(&file);
        let text = fs::read_to_string(&file).unwrap();
        let is_door = name.starts_with("src/parallel");
        assert!(is_door || !text.contains("rayon"), "{name} names rayon; call crate::parallel, which is compiled once");
    }
}

#[test]
fn the_reader_of_paths_sees_groups_and_wrong_arrows() {
    let found = paths("use crate::flow::x;\nuse crate::{io, synth::{a, b}, types};\nlet y = super::z::w();");
    let joined: Vec<String> = found.iter().map(|path| path.join("/")).collect();
    assert_eq!(joined, ["crate/flow/x", "crate/io", "crate/synth/a", "crate/synth/b", "crate/types", "super/z/w"]);
    assert!(!is_allowed("image", "flow") && !is_allowed("io", "synth") && !is_allowed("error", "types"));
    assert!(is_allowed("flow", "jet") && is_allowed("types", "error") && is_allowed("jet", "jet"));
}

#[test]
fn circles_are_found_and_chains_are_not() {
    let graph = |edges: &[(&'static str, &'static str)]| {
        let mut map: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
        for (from, to) in edges {
            map.entry(from).or_default().insert(to);
            map.entry(to).or_default();
        }
        map
    };
    assert!(circles(&graph(&[("a", "b"), ("b", "c"), ("a", "c")])).is_empty());
    assert_eq!(circles(&graph(&[("a", "b"), ("b", "c"), ("c", "b")])), [["b", "c"]]);
}
