//! The words of `docs/glossary.md`: few idioms in comments, the field's terms as names, short comment lines.

mod source;

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use source::{SOURCES, files, name_of, root, rust_files};

/// Words of the house's old idiom. Each has a plain term in the glossary.
const IDIOMS: &str = "told tell tells telling obey obeys obeyed obeying stray strays thing things otherwise something \
    whatever hardly besides altogether heeded heeds wary asked asks anew mend mends mended";

/// Idioms of several words.
const PHRASES: &[&str] = &["as far as", "such as it is", "made scene", "drawn scene"];

/// Most idioms in 1000 words of comments, in every room.
const MAX_IDIOMS_PER_1000: f64 = 4.0;

/// Longest comment line, characters.
const MAX_COMMENT_LINE: usize = 110;

/// Names that the glossary replaces, by the folder (below `src/`) in which they may not name a file, a
/// function, a type or an option; with the empty folder, nowhere. Words with an ordinary meaning elsewhere
/// are listed only for their room.
const REPLACED: &[(&str, &str)] = &[
    ("", "astray told telling asked sites spare thing things film stray strays obey obeys"),
    (
        "motion3d",
        "two otherwise alike whole hanging regions gate narrowing coherence rival rivals valley plausible \
         departure special twin signs behind turned displaced intake belief known common together \
         selected excess widen effort shared turning flow_scale flow_offset estimate_sideways sideways \
         sigma seed",
    ),
    (
        "flow",
        "common couple bonds visit wave loosen led seen spread further evidence range bending inherited \
         sound hidden",
    ),
    (
        "track",
        "outset sound rest take tell look front slanted silence freedom swung wary usual rearranged los \
         fov eps seed",
    ),
    ("cli", "los fov eps shared turning sideways seed"),
];

/// Options of the Python interface that the glossary replaces.
const REPLACED_OPTIONS: &str = "shared turning flow_scale flow_offset los fov eps check seed";

/// Whether a list of words separated by spaces has the word.
fn is_in(list: &str, word: &str) -> bool {
    list.split_whitespace().any(|listed| listed == word)
}

/// The comments of a Rust file, a line each; code blocks of documentation are left out.
fn rust_comments(text: &str) -> Vec<&str> {
    let mut in_block = false;
    text.lines()
        .filter_map(|line| line.trim_start().strip_prefix("//"))
        .map(|line| line.trim_start_matches(['/', '!']).trim())
        .filter(|line| {
            let fence = line.starts_with("```");
            in_block ^= fence;
            !fence && !in_block
        })
        .collect()
}

/// The comments and docstrings of a Python file, a line each.
fn python_comments(text: &str) -> Vec<&str> {
    let mut in_docstring = false;
    let mut found = Vec::new();
    for line in text.lines() {
        let marks = line.matches("\"\"\"").count();
        if in_docstring || marks > 0 {
            found.push(line.trim().trim_matches('"'));
        } else if let Some((_, comment)) = line.split_once("# ") {
            found.push(comment);
        }
        in_docstring ^= marks % 2 == 1;
    }
    found
}

/// Words of lines in lower case, without marks.
fn words(lines: &[&str]) -> Vec<String> {
    lines
        .iter()
        .flat_map(|line| line.split(|c: char| !c.is_alphanumeric() && c != '\''))
        .filter(|word| !word.is_empty())
        .map(str::to_lowercase)
        .collect()
}

/// Idioms among words, each with how often it occurs.
fn idioms(words: &[String]) -> BTreeMap<String, usize> {
    let mut found = BTreeMap::new();
    for word in words.iter().filter(|word| is_in(IDIOMS, word)) {
        *found.entry(word.clone()).or_default() += 1;
    }
    for phrase in PHRASES {
        let parts: Vec<&str> = phrase.split(' ').collect();
        let count = words.windows(parts.len()).filter(|window| window.iter().zip(&parts).all(|(a, b)| a == b)).count();
        if count > 0 {
            found.insert((*phrase).to_string(), count);
        }
    }
    found
}

/// The room of a source file: the folder below that of the sources, two folders where a room holds several
/// systems.
fn room(inside: &Path) -> String {
    let parts: Vec<String> = inside.iter().map(|part| part.to_string_lossy().into_owned()).collect();
    let source = if parts[0] == "src" { 1 } else { 2 };
    let depth = if ["flow", "track", "pipeline"].contains(&parts[source].as_str()) { 2 } else { 1 };
    parts[..(source + depth).min(parts.len() - 1).max(source)].join("/")
}

/// Functions and types that a Rust source declares.
fn declared(text: &str) -> Vec<String> {
    let mut names = Vec::new();
    for line in text.lines().map(str::trim_start).filter(|line| !line.starts_with("//")) {
        for keyword in ["fn ", "struct ", "enum ", "trait ", "type "] {
            if let Some(at) = line.find(keyword) {
                let is_start = line[..at].split_whitespace().all(|word| {
                    word.starts_with("pub")
                        || ["const", "async", "unsafe", "extern", "in"].contains(&word)
                        || word.ends_with(')')
                });
                let name: String =
                    line[at + keyword.len()..].chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
                if is_start && !name.is_empty() {
                    names.push(name);
                }
            }
        }
    }
    names
}

#[test]
fn comments_are_free_of_idioms() {
    let mut rooms: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for file in rust_files() {
        let text = fs::read_to_string(&file).unwrap();
        rooms.entry(room(file.strip_prefix(root()).unwrap())).or_default().extend(words(&rust_comments(&text)));
    }
    for folder in ["python", "benchmarks"] {
        for file in files(&root().join(folder), "py") {
            let text = fs::read_to_string(&file).unwrap();
            rooms.entry(folder.to_string()).or_default().extend(words(&python_comments(&text)));
        }
    }
    let mut wrong = String::new();
    for (room, words) in &rooms {
        let found = idioms(words);
        let count: usize = found.values().sum();
        let rate = 1000.0 * count as f64 / words.len().max(1) as f64;
        // One idiom in a room of few comments is no habit.
        if rate > MAX_IDIOMS_PER_1000 && count > 1 {
            let list: Vec<String> = found.iter().map(|(word, count)| format!("{word} {count}")).collect();
            wrong += &format!("{room}: {rate:.1} per 1000 words: {}\n", list.join(", "));
        }
    }
    assert!(
        wrong.is_empty(),
        "idioms per 1000 words of comments: expected at most {MAX_IDIOMS_PER_1000}, got\n{wrong}"
    );
}

/// The lines of a Python file that are comments or in docstrings, with their numbers from 1.
fn python_comment_lines(text: &str) -> Vec<(usize, &str)> {
    // Whether a text over several lines is a docstring, while there is one.
    let mut open = None;
    let mut found = Vec::new();
    for (row, line) in text.lines().enumerate() {
        let start = line.trim_start().trim_start_matches('r');
        let is_docstring = open.unwrap_or(start.starts_with("\"\"\""));
        if is_docstring || open.is_none() && start.starts_with('#') {
            found.push((row + 1, line));
        }
        if line.matches("\"\"\"").count() % 2 == 1 {
            open = if open.is_some() { None } else { Some(is_docstring) };
        }
    }
    found
}

#[test]
fn comment_lines_are_short() {
    let mut wrong = Vec::new();
    for folder in ["python", "benchmarks", "tests", "examples", "docs"] {
        // The stub of the binding repeats Rust's docstrings with another indent.
        for file in files(&root().join(folder), "py") {
            for (row, line) in python_comment_lines(&fs::read_to_string(&file).unwrap()) {
                if line.chars().count() > MAX_COMMENT_LINE && !line.contains(" | ") {
                    wrong.push(format!("{}:{row}", name_of(&file)));
                }
            }
        }
    }
    for folder in SOURCES.iter().chain(&["tests", "benches"]) {
        for file in files(&root().join(folder), "rs") {
            for (row, line) in fs::read_to_string(&file).unwrap().lines().enumerate() {
                // A row of a table cannot be broken.
                let is_comment = line.trim_start().starts_with("//") && !line.contains(" | ");
                if is_comment && line.chars().count() > MAX_COMMENT_LINE {
                    wrong.push(format!("{}:{}", name_of(&file), row + 1));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "comment lines over {MAX_COMMENT_LINE} characters:\n{}", wrong.join("\n"));
}

#[test]
fn names_are_those_of_the_field() {
    let mut wrong = Vec::new();
    for file in rust_files() {
        let inside = file.strip_prefix(root()).unwrap();
        let text = fs::read_to_string(&file).unwrap();
        let mut names = declared(&text);
        names.extend(inside.with_extension("").iter().map(|part| part.to_string_lossy().into_owned()));
        for (folder, replaced) in REPLACED {
            if folder.is_empty() || inside.starts_with(Path::new("src").join(folder)) {
                for name in names.iter().filter(|name| is_in(replaced, &name.to_lowercase())) {
                    wrong.push(format!("{}: {name}", name_of(&file)));
                }
            }
        }
    }
    wrong.dedup();
    assert!(wrong.is_empty(), "names that docs/glossary.md replaces:\n{}", wrong.join("\n"));
}

#[test]
fn options_are_those_of_the_field() {
    let mut wrong = Vec::new();
    for file in files(&root().join("python"), "py").into_iter().chain(files(&root().join("python"), "pyi")) {
        for (row, line) in fs::read_to_string(&file).unwrap().lines().enumerate() {
            // A parameter with a type: `name: type = default,`.
            let code = line.trim_start().trim_start_matches("def ");
            for part in code.split(['(', ',']).map(str::trim) {
                if let Some((name, _)) = part.split_once(": ")
                    && is_in(REPLACED_OPTIONS, name)
                {
                    wrong.push(format!("{}:{}: {name}", name_of(&file), row + 1));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "options that docs/glossary.md replaces:\n{}", wrong.join("\n"));
}

#[test]
fn the_readers_find_what_they_look_for() {
    let rust =
        "//! What is told.\n/// ```\n/// told\n/// ```\npub fn sites() {}\nlet x = 1; // asked\nstruct Told<T>(T);\n";
    assert_eq!(rust_comments(rust), ["What is told."]);
    assert_eq!(declared(rust), ["sites", "Told"]);
    assert_eq!(python_comments("\"\"\"Told.\"\"\"\nx = 1  # asked\ny = 2\n"), ["Told.", "asked"]);
    let python = "\"\"\"One.\n# two\n\"\"\"\nx = \"\"\"\nfour\n\"\"\"\n    # seven\n    r\"\"\"Eight.\"\"\"\n";
    assert_eq!(python_comment_lines(python).iter().map(|(row, _)| *row).collect::<Vec<_>>(), [1, 2, 3, 7, 8]);
    let found = idioms(&words(&["As far as it is told, told well."]));
    assert_eq!((found["told"], found["as far as"]), (2, 1));
    assert_eq!(room(Path::new("src/flow/windowed/run.rs")), "src/flow/windowed");
    assert_eq!(room(Path::new("python/src/field/mod.rs")), "python/src/field");
}

#[test]
fn constants_name_what_they_bound() {
    let mut wrong = Vec::new();
    for file in rust_files() {
        for line in fs::read_to_string(&file).unwrap().lines() {
            let Some((_, rest)) = line.split_once("const ") else { continue };
            let name: String = rest.chars().take_while(|c| c.is_ascii_uppercase() || *c == '_').collect();
            if !line.trim_start().starts_with("//") && name.split('_').any(|word| is_in("LEAST MOST ENOUGH", word)) {
                wrong.push(format!("{}: {name}", name_of(&file)));
            }
        }
    }
    assert!(wrong.is_empty(), "constants: expected MIN, MAX, a threshold or a tolerance, got\n{}", wrong.join("\n"));
}
