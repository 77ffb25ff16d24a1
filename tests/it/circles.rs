//! Files of a crate know one another in one direction: read from the sources, names followed to where they are defined.
//!
//! What is seen: `use`, and paths that start at `crate`, `self`, `super`, a child module or a name brought in by `use`.
//! Re-exports are followed, and are no knowledge themselves. A module and what lies below it are one thing: it may take
//! from its parts and they from it. Code of tests and the inside of macros are left out.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use petgraph::algo::tarjan_scc;
use petgraph::graphmap::DiGraphMap;
use syn::visit::{self, Visit};
use syn::{Attribute, Item, ItemMod, UseTree, Visibility};

/// Files of a crate from which on some must be seen to know others.
const SOME_FILES: usize = 6;

/// Circles that are there and have still to be cut: one may get smaller, and none may be added.
const STILL_TIED: &[&[&str]] = &[];

/// Re-exports of one name that are followed.
const MOST_RE_EXPORTS: u32 = 8;

/// A module's path from the root of its crate.
type Module = Vec<String>;

/// What one file says.
#[derive(Default)]
struct Source {
    file: PathBuf,
    /// Names brought in, with where they come from as written.
    brought: BTreeMap<String, Vec<String>>,
    /// Of these, what others may take from here.
    passed_on: BTreeSet<String>,
    /// Modules whose every name is brought in.
    brought_whole: Vec<Vec<String>>,
    /// Paths in its code.
    paths: BTreeSet<Vec<String>>,
}

fn is_of_tests(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        let mut is_test = false;
        if attribute.path().is_ident("cfg") {
            let read = attribute.parse_nested_meta(|meta| {
                is_test |= meta.path.is_ident("test");
                Ok(())
            });
            // A condition of another form is none of tests.
            is_test &= read.is_ok();
        }
        is_test
    })
}

impl Source {
    fn take(&mut self, tree: &UseTree, mut prefix: Vec<String>, is_passed_on: bool) {
        let mut bring = |name: String, path: Vec<String>| {
            if is_passed_on {
                self.passed_on.insert(name.clone());
            }
            self.brought.insert(name, path);
        };
        match tree {
            UseTree::Path(path) => {
                prefix.push(path.ident.to_string());
                self.take(&path.tree, prefix, is_passed_on);
            }
            UseTree::Name(name) if name.ident == "self" => {
                let own = prefix.last().cloned().unwrap_or_default();
                bring(own, prefix);
            }
            UseTree::Name(name) => {
                prefix.push(name.ident.to_string());
                bring(name.ident.to_string(), prefix);
            }
            UseTree::Rename(rename) => {
                if rename.ident != "self" {
                    prefix.push(rename.ident.to_string());
                }
                bring(rename.rename.to_string(), prefix);
            }
            UseTree::Glob(_) => self.brought_whole.push(prefix),
            UseTree::Group(group) => {
                for tree in &group.items {
                    self.take(tree, prefix.clone(), is_passed_on);
                }
            }
        }
    }
}

impl<'ast> Visit<'ast> for Source {
    fn visit_item(&mut self, item: &'ast Item) {
        match item {
            Item::Mod(module) if is_of_tests(&module.attrs) => {}
            Item::Fn(function) if is_of_tests(&function.attrs) => {}
            Item::Impl(block) if is_of_tests(&block.attrs) => {}
            Item::Use(used) if is_of_tests(&used.attrs) => {}
            Item::Use(used) => {
                let is_passed_on = !matches!(used.vis, Visibility::Inherited);
                self.take(&used.tree, vec![], is_passed_on);
            }
            item => visit::visit_item(self, item),
        }
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        if path.leading_colon.is_none() && path.segments.len() > 1 {
            let names = path.segments.iter().map(|part| part.ident.to_string());
            self.paths.insert(names.collect());
        }
        visit::visit_path(self, path);
    }
}

/// The files of a crate by module.
struct Crate {
    sources: BTreeMap<Module, Source>,
}

impl Crate {
    fn read(root: &Path) -> Self {
        let mut sources = BTreeMap::new();
        let folder = root.parent().unwrap().to_owned();
        let mut open = vec![(Module::new(), root.to_owned(), folder)];
        while let Some((module, file, folder)) = open.pop() {
            let text = std::fs::read_to_string(&file).unwrap();
            let parsed =
                syn::parse_file(&text).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
            let mut source = Source {
                file,
                ..Source::default()
            };
            source.visit_file(&parsed);
            for item in &parsed.items {
                let Item::Mod(child) = item else { continue };
                let Some((file, folder)) = file_of(child, &folder) else {
                    continue;
                };
                let mut path = module.clone();
                path.push(child.ident.to_string());
                open.push((path, file, folder));
            }
            sources.insert(module, source);
        }
        Self { sources }
    }

    /// The module in which a path that is written in `from` starts, and the rest of it; none if it leads out of the crate.
    fn start(&self, from: &Module, path: &[String]) -> Option<(Module, Vec<String>)> {
        let (first, rest) = path.split_first()?;
        let mut module = from.clone();
        match first.as_str() {
            "crate" => return Some((vec![], rest.to_vec())),
            "self" => return Some((module, rest.to_vec())),
            "super" => {
                module.pop()?;
                // More of the same may follow.
                let follows = rest.first().is_some_and(|next| next == "super");
                return if follows {
                    self.start(&module, rest)
                } else {
                    Some((module, rest.to_vec()))
                };
            }
            _ => {}
        }
        let mut child = module.clone();
        child.push(first.clone());
        if self.sources.contains_key(&child) {
            return Some((child, rest.to_vec()));
        }
        let brought = self.sources[from].brought.get(first)?;
        // `use serde;` and the like brings in what is outside; so does a name that is brought in as itself.
        if brought.first() == Some(first) {
            return None;
        }
        let (module, mut way) = self.start(from, brought)?;
        way.extend_from_slice(rest);
        Some((module, way))
    }

    /// The module that defines what a path leads to; none if it leads out of the crate or to a whole module.
    fn definer(&self, from: &Module, path: &[String], depth: u32) -> Option<Module> {
        let (mut module, way) = self.start(from, path)?;
        let mut way = way.as_slice();
        while let Some((name, rest)) = way.split_first() {
            let mut child = module.clone();
            child.push(name.clone());
            if self.sources.contains_key(&child) {
                module = child;
                way = rest;
                continue;
            }
            let source = &self.sources[&module];
            if depth < MOST_RE_EXPORTS && source.passed_on.contains(name) {
                let mut on = source.brought[name].clone();
                on.extend_from_slice(rest);
                return self.definer(&module, &on, depth + 1);
            }
            return Some(module);
        }
        None
    }

    /// Which file takes a name from which other.
    fn edges(&self) -> BTreeMap<(&Path, &Path), String> {
        let mut edges = BTreeMap::new();
        for (module, source) in &self.sources {
            let brought = source
                .brought
                .iter()
                .filter(|(name, _)| !source.passed_on.contains(*name))
                .map(|(_, path)| path);
            let whole = source.brought_whole.iter().map(|path| {
                let mut all = path.clone();
                all.push("*".to_owned());
                Cow::Owned(all)
            });
            let paths = brought.chain(&source.paths).map(Cow::Borrowed);
            for path in paths.chain(whole) {
                let Some(other) = self.definer(module, &path, 0) else {
                    continue;
                };
                if module.starts_with(&other) {
                    continue;
                }
                let other = self.sources[&other].file.as_path();
                if other != source.file {
                    let name = path.last().cloned().unwrap_or_default();
                    edges.entry((source.file.as_path(), other)).or_insert(name);
                }
            }
        }
        edges
    }

    /// Files that know one another in both directions, sorted, with the names that tie them.
    fn circles(&self) -> Vec<(Vec<&Path>, String)> {
        let edges = self.edges();
        let graph: DiGraphMap<&Path, ()> = edges.keys().map(|(from, to)| (*from, *to)).collect();
        let mut circles = vec![];
        for mut circle in tarjan_scc(&graph) {
            if circle.len() < 2 {
                continue;
            }
            circle.sort();
            let inside = edges
                .iter()
                .filter(|((from, to), _)| circle.contains(from) && circle.contains(to));
            let lines = inside.map(|((from, to), name)| {
                format!("\n  {} takes {name} from {}", from.display(), to.display())
            });
            let text = format!("{} files:{}", circle.len(), lines.collect::<String>());
            circles.push((circle, text));
        }
        circles.sort();
        circles
    }
}

/// The file of a child module, and the folder of its own children; none for one that is written in place or for tests.
fn file_of(child: &ItemMod, folder: &Path) -> Option<(PathBuf, PathBuf)> {
    if child.content.is_some() || is_of_tests(&child.attrs) {
        return None;
    }
    let own = folder.join(child.ident.to_string());
    let beside = own.with_extension("rs");
    let file = if beside.is_file() {
        beside
    } else {
        own.join("mod.rs")
    };
    // Generated code is included elsewhere.
    file.is_file().then_some((file, own))
}

/// Root files of the crates of the workspace.
fn roots(workspace: &Path) -> Vec<PathBuf> {
    let settings = std::fs::read_to_string(workspace.join("Cargo.toml")).unwrap();
    let (_, members) = settings.split_once("members = [").unwrap();
    let (members, _) = members.split_once(']').unwrap();
    let sources = members.split('"').skip(1).step_by(2);
    let sources = sources.map(|member| workspace.join(member).join("src"));
    let roots = sources.flat_map(|folder| ["lib.rs", "main.rs"].map(|file| folder.join(file)));
    roots.filter(|root| root.is_file()).collect()
}

#[test]
fn files_of_a_crate_know_one_another_in_one_direction() {
    let workspace = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."));
    let (mut new, mut left) = (vec![], BTreeSet::new());
    let roots = roots(workspace);
    assert!(roots.len() > 15, "{roots:?}");
    for root in roots {
        let read = Crate::read(&root);
        assert!(
            read.sources.len() < SOME_FILES || read.edges().len() > 3,
            "{}: its files were not understood",
            root.display()
        );
        for (files, text) in read.circles() {
            let names = files
                .iter()
                .map(|file| file.strip_prefix(workspace).unwrap());
            let names: BTreeSet<&str> = names.map(|name| name.to_str().unwrap()).collect();
            // A circle may lose files, not win any.
            let known = STILL_TIED
                .iter()
                .position(|known| names.iter().all(|name| known.contains(name)));
            match known {
                Some(known) => _ = left.insert(known),
                None => new.push(text),
            }
        }
    }
    let prefix = format!("{}/", workspace.display());
    assert!(new.is_empty(), "{}", new.join("\n").replace(&prefix, ""));
    let cut: Vec<_> = (0..STILL_TIED.len())
        .filter(|i| !left.contains(i))
        .collect();
    assert!(cut.is_empty(), "cut: take numbers {cut:?} off the list");
}

#[test]
fn a_circle_is_seen_through_re_exports_and_modules_brought_in() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("lib.rs", "mod a; mod b; mod c; pub use a::A;");
    write("a.rs", "use crate::b; pub struct A(b::B);");
    write("b.rs", "use crate::A; pub struct B(Option<Box<A>>);");
    write(
        "c.rs",
        "use super::A; #[cfg(test)] mod tests { use crate::b::B; } struct C(A);",
    );
    let read = Crate::read(&folder.path().join("lib.rs"));
    let circles = read.circles();
    assert_eq!(circles.len(), 1, "{circles:?}");
    assert_eq!(circles[0].0.len(), 2, "{circles:?}");
    assert!(circles[0].1.contains("takes A from"), "{circles:?}");
}
