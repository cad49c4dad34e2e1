//! What a module calls all that it defines: each name at its top level begins with a prefix, so that modules of several shapes stand in one
//! shader, beside an engine's own `PI`. Texts are renamed and not naga's modules, as naga writes helpers that its modules do not have.

use std::collections::BTreeSet;
use std::fmt;
use std::str::FromStr;

use serde::Serialize;

use super::Error;

/// What each name of a module begins with, in front of an underscore; `neubrdf` by default.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Prefix(String);

/// What cannot be a prefix.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "'{0}' is no prefix: expected letters and digits of ASCII with single underscores between them, a letter first, and not gl, which is GLSL's"
)]
pub struct NoPrefix(pub String);

impl Prefix {
    const DEFAULT: &str = "neubrdf";
    /// How the names begin that have the default prefix already: functions and variables, structs, constants.
    const FORMS: [&str; 3] = ["neubrdf_", "NeuBrdf", "NEUBRDF_"];

    /// What is called `name` in glsl/: under the prefix `gold`, `neubrdf_eval` is `gold_eval`, `NeuBrdfSample` is `gold_Sample`, and `PI` is
    /// `gold_PI`.
    pub fn of(&self, name: &str) -> String {
        match Prefix::FORMS.iter().find_map(|form| name.strip_prefix(form)) {
            Some(_) if self.0 == Prefix::DEFAULT => name.to_owned(),
            Some(own) => format!("{self}_{own}"),
            None => format!("{self}_{name}"),
        }
    }

    /// A module with the names that it defines under this prefix.
    pub(super) fn apply(&self, module: &str) -> Result<String, Error> {
        let names = defined(module);
        // A local variable of a new name would hide what is meant.
        let locals: BTreeSet<&str> =
            module.lines().flat_map(|line| tokens(code(line))).filter(|word| !names.contains(word)).collect();
        if names.iter().any(|name| locals.contains(&*self.of(name))) {
            return Err(Error::Prefix(self.clone()));
        }
        let mut renamed = String::new();
        let mut before = "";
        for token in tokens(module) {
            // In comments, what is behind a slash is a file.
            match names.contains(token) && before != "/" {
                true => renamed.push_str(&self.of(token)),
                false => renamed.push_str(token),
            }
            before = token;
        }
        Ok(renamed)
    }

    /// A module that a shader may include twice. With another one under its prefix it is an error: it would be skipped, and its models evaluated
    /// with the other one's constants.
    pub(super) fn guard(&self, module: &str) -> String {
        let guard = self.of("NEUBRDF_MODULE");
        let [a, b, c, d, ..] = *blake3::hash(module.as_bytes()).as_bytes();
        // Preprocessors count in signed integers.
        let hash = u32::from_le_bytes([a, b, c, d]) >> 1;
        format!(
            "#ifdef {guard}\n#if {guard} != {hash}\n\
             #error Two NeuBRDF modules have the prefix {self}: give one of them another with neubrdf export --prefix\n\
             #endif\n#else\n#define {guard} {hash}\n\n{module}\n#endif\n"
        )
    }
}

impl Default for Prefix {
    fn default() -> Prefix {
        Prefix(Prefix::DEFAULT.to_owned())
    }
}

impl fmt::Display for Prefix {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl FromStr for Prefix {
    type Err = NoPrefix;

    fn from_str(word: &str) -> Result<Prefix, NoPrefix> {
        let is_valid = word.starts_with(|c: char| c.is_ascii_alphabetic())
            && word.split('_').next() != Some("gl")
            && word.split('_').all(|part| !part.is_empty() && part.chars().all(|c| c.is_ascii_alphanumeric()));
        if is_valid { Ok(Prefix(word.to_owned())) } else { Err(NoPrefix(word.to_owned())) }
    }
}

/// The names of a module's top level, and of its macros. There a name stands behind the word that says its type or kind, or behind the end of
/// a block, and before what begins its contents: this holds for what glsl/ and naga write, in all languages.
fn defined(module: &str) -> BTreeSet<&str> {
    let mut names = BTreeSet::new();
    let mut top_level = Vec::new();
    let mut depth = 0u32;
    for line in module.lines().map(code) {
        if let Some(directive) = line.strip_prefix('#') {
            let mut words = directive.split_whitespace();
            if let Some("define" | "ifdef" | "ifndef") = words.next() {
                names.extend(words.next());
            }
            continue;
        }
        for token in tokens(line).filter(|token| !token.trim().is_empty()) {
            depth = depth.saturating_sub(u32::from(matches!(token, ")" | "]" | "}")));
            if depth == 0 {
                top_level.push(token);
            }
            depth += u32::from(matches!(token, "(" | "[" | "{"));
        }
    }
    for tokens in top_level.windows(3) {
        let [before, name, after] = *tokens else { continue };
        let is_defined = match after {
            "(" | "[" | "{" | "=" => is_word(before),
            ";" => is_word(before) || before == "}",
            ":" => is_word(before) || before == ">",
            _ => false,
        };
        // The kernel of GLSL can have no other name.
        if is_defined && is_word(name) && name != "main" {
            names.insert(name);
        }
    }
    names
}

/// A line without its comment.
fn code(line: &str) -> &str {
    line.split("//").next().unwrap_or(line)
}

/// Words, and one by one the characters between them; `::`, which does not end a name, is one.
fn tokens(text: &str) -> impl Iterator<Item = &str> {
    let mut rest = text;
    std::iter::from_fn(move || {
        let length = match rest.find(|c: char| !is_of_words(c)) {
            Some(0) if rest.starts_with("::") => 2,
            Some(0) => rest.chars().next()?.len_utf8(),
            Some(length) => length,
            None if rest.is_empty() => return None,
            None => rest.len(),
        };
        let (token, others) = rest.split_at(length);
        rest = others;
        Some(token)
    })
}

fn is_word(token: &str) -> bool {
    token.starts_with(is_of_words)
}

fn is_of_words(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_'
}
