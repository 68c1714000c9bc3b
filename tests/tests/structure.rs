//! What the layout promises: imports go downwards only, and some words have one place.
//!
//! The imports are read from the source itself (every `use` and every path that begins with `crate`,
//! `super` or `self`), test code left out.

use petgraph::algo::tarjan_scc;
use petgraph::graphmap::DiGraphMap;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use syn::visit::{self, Visit};

/// The floors of host-sim from the ground up; a module imports from floors below its own.
const FLOORS: [&[&str]; 12] = [
    &["error"],
    &["output"],
    &["linear"],
    &["chain"],
    &["machine"],
    &["drive"],
    &["design"],
    &["simulate"],
    &["excite", "identify", "compare", "capture"],
    &["sweep"],
    &["link"],
    &["report"],
];
/// The roof imports from everything, and nothing from it.
const ROOF: &str = "cli";

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Every source file below a folder, with its module path.
fn sources(folder: &str) -> Vec<(PathBuf, Vec<String>, String)> {
    let top = root().join(folder);
    let (mut folders, mut files) = (vec![top.clone()], Vec::new());
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|ext| ext == "rs") {
                let module = path.strip_prefix(&top).unwrap().with_extension("");
                let parts = module
                    .iter()
                    .map(|part| part.to_string_lossy().into_owned());
                let module: Vec<String> = parts.filter(|part| part != "mod").collect();
                let text = std::fs::read_to_string(&path).unwrap();
                files.push((path, module, text));
            }
        }
    }
    let made_for_tests = |module: &[String]| module.last().is_some_and(|name| name == "tests");
    files.retain(|(_, module, _)| !made_for_tests(module));
    files.sort();
    assert!(files.len() > 3, "{folder} is not there");
    files
}

/// Collects what a file refers to, as paths from the root of its crate.
struct Paths {
    module: Vec<String>,
    found: BTreeSet<Vec<String>>,
}

impl Paths {
    fn take(&mut self, path: &[String]) {
        let mut at = match path.first().map(String::as_str) {
            Some("crate") => Vec::new(),
            Some("super" | "self") => self.module.clone(),
            _ => return,
        };
        for part in path {
            match part.as_str() {
                "crate" | "self" => {}
                "super" => {
                    at.pop();
                }
                name => at.push(name.to_owned()),
            }
        }
        self.found.insert(at);
    }

    fn take_use(&mut self, tree: &syn::UseTree, before: &[String]) {
        let mut path = before.to_vec();
        match tree {
            syn::UseTree::Path(next) => {
                path.push(next.ident.to_string());
                self.take_use(&next.tree, &path);
            }
            syn::UseTree::Name(name) => {
                path.push(name.ident.to_string());
                self.take(&path);
            }
            syn::UseTree::Rename(name) => {
                path.push(name.ident.to_string());
                self.take(&path);
            }
            syn::UseTree::Group(group) => {
                for tree in &group.items {
                    self.take_use(tree, &path);
                }
            }
            syn::UseTree::Glob(_) => self.take(&path),
        }
    }
}

fn for_tests(attributes: &[syn::Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        attribute.path().is_ident("cfg")
            && attribute
                .parse_args::<syn::Path>()
                .is_ok_and(|path| path.is_ident("test"))
    })
}

impl<'ast> Visit<'ast> for Paths {
    fn visit_item_mod(&mut self, item: &'ast syn::ItemMod) {
        if !for_tests(&item.attrs) {
            self.module.push(item.ident.to_string());
            visit::visit_item_mod(self, item);
            self.module.pop();
        }
    }

    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        self.take_use(&item.tree, &[]);
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        let parts: Vec<String> = path.segments.iter().map(|s| s.ident.to_string()).collect();
        self.take(&parts);
        visit::visit_path(self, path);
    }
}

/// Imports of one file, each as (module, imported module), both the first below the crate's root.
fn imports(module: &[String], text: &str) -> BTreeSet<(String, String)> {
    let mut paths = Paths {
        module: module.to_vec(),
        found: BTreeSet::new(),
    };
    paths.visit_file(&syn::parse_file(text).unwrap());
    let Some(from) = module.first() else {
        return BTreeSet::new();
    };
    let to = paths.found.iter().filter_map(|path| path.first());
    to.filter(|to| *to != from)
        .map(|to| (from.clone(), to.clone()))
        .collect()
}

/// Imports between the top modules of a crate.
fn graph(folder: &str) -> BTreeSet<(String, String)> {
    let files = sources(folder);
    let modules: BTreeSet<String> = files
        .iter()
        .filter_map(|(_, m, _)| m.first().cloned())
        .collect();
    files
        .iter()
        .filter(|(_, module, _)| !["lib", "main"].contains(&module[0].as_str()))
        .flat_map(|(_, module, text)| imports(module, text))
        .filter(|(_, to)| modules.contains(to))
        .collect()
}

/// Modules that import each other in a circle.
fn circles(graph: &BTreeSet<(String, String)>) -> Vec<Vec<&str>> {
    let edges = graph.iter().map(|(from, to)| (from.as_str(), to.as_str()));
    let graph = DiGraphMap::<&str, ()>::from_edges(edges);
    let circles = tarjan_scc(&graph).into_iter();
    circles.filter(|circle| circle.len() > 1).collect()
}

/// Imports that do not go down.
fn upwards(graph: &BTreeSet<(String, String)>) -> Vec<String> {
    let floor = |name: &str| {
        let found = FLOORS.iter().position(|floor| floor.contains(&name));
        found.unwrap_or_else(|| {
            assert!(name == ROOF, "{name} is on no floor");
            FLOORS.len()
        })
    };
    let wrong = graph.iter().filter(|(from, to)| floor(to) >= floor(from));
    wrong
        .map(|(from, to)| format!("{from} imports {to}"))
        .collect()
}

#[test]
fn host_sim_imports_downwards_only() {
    let graph = graph("host-sim/src");
    assert!(graph.len() > 30, "{graph:?}");
    assert_eq!(upwards(&graph), [""; 0]);
    assert_eq!(circles(&graph), Vec::<Vec<&str>>::new());
}

#[test]
fn the_core_has_no_circle() {
    let graph = graph("core/src");
    assert!(graph.len() > 30, "{graph:?}");
    assert_eq!(circles(&graph), Vec::<Vec<&str>>::new());
}

/// What must not come back, by the place where a word may stand.
fn misplaced(path: &str, text: &str) -> Option<&'static str> {
    let code: Vec<&str> = text
        .lines()
        .map(str::trim_start)
        .filter(|line| !line.starts_with("//"))
        .collect();
    let has = |word: &str| {
        let apart = |c: char| !(c.is_alphanumeric() || c == '_');
        code.iter()
            .any(|line| line.split(apart).any(|found| found == word))
    };
    if path.contains("firmware/src/board") && has("GAINS") {
        return Some("a board knows no gains: settings.rs holds them against what it can do");
    }
    if path.contains("host-sim/src") && !path.contains("host-sim/src/cli") && has("clap") {
        return Some("the command line is the business of cli/");
    }
    None
}

#[test]
fn words_stand_in_their_place() {
    for folder in ["host-sim/src", "firmware/src"] {
        for (path, _, text) in sources(folder) {
            let path = path.to_string_lossy();
            // The program itself hands its arguments to the command line.
            if !path.ends_with("host-sim/src/main.rs") {
                assert_eq!(misplaced(&path, &text), None, "{path}");
            }
        }
    }
}

/// Each of these would be found.
#[test]
fn what_is_put_in_the_wrong_place_is_found() {
    let module = |path: &str| -> Vec<String> { path.split("::").map(Into::into).collect() };
    let found = |path: &str, text: &str| upwards(&imports(&module(path), text));
    for text in [
        "use crate::design::Design;",
        "use crate::{error::Error, design};",
        "use super::super::design as d;",
        "fn f() -> crate::design::Design { todo!() }",
        "fn f() { let x = crate::design::new(); }",
    ] {
        assert_eq!(
            found("drive::document", text),
            ["drive imports design"],
            "{text}"
        );
    }
    assert_eq!(
        found("design::checks", "use super::super::report::table;"),
        ["design imports report"]
    );
    // Not upwards: the same floor's own parts, floors below, tests.
    assert_eq!(
        found(
            "drive::document",
            "use super::Drive; use crate::error; #[cfg(test)] mod tests { use crate::cli; }"
        ),
        [""; 0]
    );
    assert_eq!(
        found("excite", "use crate::identify::LEAST;"),
        ["excite imports identify"]
    );

    let pair = |a: &str, b: &str| (a.to_owned(), b.to_owned());
    let graph = BTreeSet::from([
        pair("a", "b"),
        pair("b", "c"),
        pair("c", "a"),
        pair("c", "d"),
    ]);
    assert_eq!(circles(&graph).len(), 1);

    let board = "firmware/src/board/stm32f405/encoder.rs";
    assert!(misplaced(board, "let bits = GAINS.encoder.counter_bits;").is_some());
    assert!(misplaced(board, "// no GAINS here\nlet gains = 1;").is_none());
    assert!(misplaced("host-sim/src/excite.rs", "#[derive(clap::ValueEnum)]").is_some());
    assert!(misplaced("host-sim/src/cli/excite.rs", "use clap::Args;").is_none());
}
