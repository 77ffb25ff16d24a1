//! How many queries a question comes to once each name of its WITH stands for its query: the text in; a refusal out where they are more than a
//! plan may hold.
//!
//! The engine plans a query anew wherever its name is read. Where each reads the one before twice, the plan doubles with each: a question of a
//! kilobyte takes all memory while it is planned, which no limit of memory counts, and no limit of time ends what plans.

use std::collections::HashMap;

use datafusion::sql::sqlparser::dialect::GenericDialect;
use datafusion::sql::sqlparser::keywords::Keyword;
use datafusion::sql::sqlparser::tokenizer::{Token, Tokenizer, Word};

/// Most queries and joins, with those that names stand for: this many are planned in 0.1 s, half a million in longer than 40 s and 1.7 GiB.
const MAX_COPIES: usize = 2000;

/// A bracket that is open.
struct Open {
    at: usize,
    /// Of the query in it, if WITH may give it one.
    name: Option<String>,
    /// Does WITH give it for sure? Then the query counts where its name is read alone.
    is_given: bool,
    /// Queries before it.
    before: usize,
}

/// What was read so far.
#[derive(Default)]
struct Copies {
    queries: usize,
    /// Queries that a name stands for, by small letters, and the most where letters alone tell names apart: more may be counted, never less.
    named: HashMap<String, usize>,
    /// Has a name points in it? Then what stands beside a point may be a part of one.
    has_points: bool,
    open: Vec<Open>,
    /// Where the brackets that were closed last opened.
    closed: usize,
    /// Of every bracket that is open, and of the text: do names of WITH follow?
    is_with: Vec<bool>,
}

/// Refuses a text whose queries would be too many, with the reason. One that cannot be cut into words is left to the parser, which says why.
pub(super) fn check(text: &str) -> Result<(), String> {
    let Ok(all) = Tokenizer::new(&GenericDialect {}, text).tokenize() else {
        return Ok(());
    };
    let all = all.iter();
    let tokens: Vec<&Token> = all
        .filter(|token| !matches!(token, Token::Whitespace(_)))
        .collect();
    let mut copies = Copies {
        is_with: vec![false],
        ..Copies::default()
    };
    for at in 0..tokens.len() {
        copies.take(&tokens, at);
    }
    if copies.queries <= MAX_COPIES {
        return Ok(());
    }
    Err(format!(
        "its queries come to more than {MAX_COPIES}, each as often as its name in WITH is read, where it stands for the whole of it: read each fewer times"
    ))
}

impl Copies {
    fn take(&mut self, tokens: &[&Token], at: usize) {
        match tokens[at] {
            Token::LParen => {
                self.open.push(Open {
                    at,
                    name: name_of(&tokens[..at], self.closed),
                    is_given: self.is_with.last() == Some(&true),
                    before: self.queries,
                });
                self.is_with.push(false);
            }
            Token::RParen => {
                if let Some(own) = self.open.pop() {
                    self.is_with.pop();
                    self.close(own);
                }
            }
            Token::Word(word) => {
                let is_first = at == 0 || *tokens[at - 1] == Token::LParen;
                if word.keyword == Keyword::WITH && is_first {
                    self.set_with(true);
                }
                let is_point = |at: usize| tokens.get(at).is_some_and(|it| **it == Token::Period);
                let is_part = is_point(at.wrapping_sub(1)) || is_point(at + 1);
                self.word(word, is_part);
            }
            _ => {}
        }
    }

    fn close(&mut self, own: Open) {
        self.closed = own.at;
        let Some(name) = own.name else { return };
        self.has_points |= name.contains('.');
        let last = name.rsplit('.').next().unwrap_or_default();
        let known = self.named.entry(last.to_owned()).or_default();
        *known = (self.queries - own.before).max(*known);
        if own.is_given {
            self.queries = own.before;
        }
    }

    /// `is_part`: it stands beside a point.
    fn word(&mut self, word: &Word, is_part: bool) {
        let own = match word.keyword {
            Keyword::SELECT | Keyword::VALUES => {
                self.set_with(false);
                1
            }
            Keyword::FROM => {
                self.set_with(false);
                0
            }
            Keyword::JOIN | Keyword::UNION => 1,
            // A column of a table that is named, and no table.
            _ if is_part && !self.has_points => 0,
            _ => *self.named.get(&word.value.to_lowercase()).unwrap_or(&0),
        };
        self.queries = self.queries.saturating_add(own);
    }

    fn set_with(&mut self, is_with: bool) {
        if let Some(own) = self.is_with.last_mut() {
            *own = is_with;
        }
    }
}

/// The name that WITH gives to what a bracket opens, in `NAME AS (`, `NAME (columns) AS (` and both without AS: what stands before the
/// bracket in, and where the brackets before it opened.
fn name_of(before: &[&Token], closed: usize) -> Option<String> {
    let is = |token: &Token, keyword: Keyword| matches!(token, Token::Word(word) if word.keyword == keyword);
    let before = match before.split_last()? {
        (last, rest) if is(last, Keyword::AS) => rest,
        _ => before,
    };
    let before = match before.last()? {
        Token::RParen => before.get(..closed)?,
        _ => before,
    };
    let (name, before) = before.split_last()?;
    let Token::Word(name) = name else { return None };
    let is_given = match before.last()? {
        Token::Comma => true,
        last => is(last, Keyword::WITH) || is(last, Keyword::RECURSIVE),
    };
    is_given.then(|| name.value.to_lowercase())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Queries each of which reads the one before so.
    fn chain(count: usize, step: impl Fn(usize) -> String) -> String {
        let first = "t0 AS (SELECT 1 AS a)".to_owned();
        let steps: Vec<String> = std::iter::once(first).chain((0..count).map(step)).collect();
        format!("WITH {} SELECT count(*) FROM t{count}", steps.join(", "))
    }

    #[test]
    fn queries_that_double_with_each_that_reads_them_are_refused() {
        let sides = |at: usize| format!("t{} AS (SELECT x.a FROM t{at} x, t{at} y)", at + 1);
        let united = |at: usize| {
            let one = format!("SELECT a FROM T{at}");
            format!("\"t{}\" (a) AS ({one} UNION ALL {one})", at + 1)
        };
        let inner = |at: usize| {
            let one = format!("(SELECT max(a) FROM t{at})");
            format!("t{} AS (SELECT {one} + {one} AS a)", at + 1)
        };
        for text in [chain(30, sides), chain(30, united), chain(30, inner)] {
            assert!(check(&text).is_err(), "{text}");
        }
        let bare = |at: usize| format!("t{} (SELECT x.a FROM t{at} x, t{at} y)", at + 1);
        let listed = |at: usize| format!("t{} (a) (SELECT x.a FROM t{at} x, t{at} y)", at + 1);
        for text in [chain(30, bare), chain(30, listed)] {
            assert!(check(&text).is_err(), "{text}");
        }
        let pointed = |at: usize| format!("\"p.t{}\" AS (SELECT 1 FROM p.t{at}, p.t{at})", at + 1);
        let text = chain(30, pointed).replace("t0 AS", "\"p.t0\" AS");
        assert!(check(&text).is_err(), "{text}");
        assert!(check(&chain(5000, sides)).is_err());
    }

    #[test]
    fn queries_that_are_read_once_or_a_few_times_are_taken() {
        let once = |at: usize| format!("t{} AS (SELECT t{at}.a + t{at}.a AS a FROM t{at})", at + 1);
        let twice = |at: usize| format!("t{} AS (SELECT x.a FROM t{at} x, t{at} y)", at + 1);
        for text in [
            chain(150, once),
            chain(7, twice),
            "WITH a AS (SELECT 1 AS x) SELECT a.x, a.x, a.x FROM a".to_owned(),
            format!("SELECT {} FROM t", vec!["f(a)"; 1500].join(", ")),
            format!(
                "SELECT {} FROM t",
                ["(SELECT max(a) FROM t)"; 150].join(", ")
            ),
            "SELECT 'it ends nowhere".to_owned(),
        ] {
            assert_eq!(check(&text), Ok(()), "{text}");
        }
    }
}
