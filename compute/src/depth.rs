//! How deep what is asked would be: the text of a question or an expression in; a refusal out where what reads, plans and answers it would need
//! more of a thread's stack than there is.
//!
//! The parser counts brackets in brackets. What stands in a chain (`a + b + c`, `a OR b OR c`, tables that are joined, queries that read the one
//! before) has no brackets and is as deep: a thread whose stack overflows ends the process, with all that others asked of it.

use datafusion::sql::sqlparser::dialect::GenericDialect;
use datafusion::sql::sqlparser::keywords::Keyword;
use datafusion::sql::sqlparser::tokenizer::{Token, Tokenizer};

/// Most operators one in another, of all queries of a question together: with 2 MiB of stack, as a thread has, 1200 are planned and 1500 are not.
const MAX_OPERATORS: usize = 500;
/// Most queries, joins and tables: 500 that read each other are planned, 800 overflow the same stack.
const MAX_QUERIES: usize = 200;

/// Refuses a text that would be too deep, with the reason. One that cannot be cut into words is left to the parser, which says why.
pub(crate) fn check(text: &str) -> Result<(), String> {
    let Ok(tokens) = Tokenizer::new(&GenericDialect {}, text).tokenize() else {
        return Ok(());
    };
    let mut depths = Depths {
        deepest: vec![0],
        ..Depths::default()
    };
    for token in &tokens {
        depths.take(token);
    }
    if depths.query_count > MAX_QUERIES {
        return Err(format!(
            "it has more than {MAX_QUERIES} queries, joins and tables: ask for fewer at a time"
        ));
    }
    if depths.deepest.iter().sum::<usize>() > MAX_OPERATORS {
        return Err(format!(
            "it has more than {MAX_OPERATORS} operators one in another: give values as IN (...), or ask in parts"
        ));
    }
    Ok(())
}

/// What stands between two brackets, or between CASE and END.
#[derive(Debug, Clone, Copy, Default)]
struct Level {
    /// The query that it belongs to.
    query: usize,
    /// Operators that it stands in.
    around: usize,
    /// Those, and the ones before in the expression that is being read: each has all before it as its left side.
    depth: usize,
    is_case: bool,
    /// Do commas stand between tables?
    is_from: bool,
    /// Does it name a type, whose commas end no expression?
    has_type: bool,
}

/// What was read so far.
#[derive(Debug, Default)]
struct Depths {
    now: Level,
    outer: Vec<Level>,
    /// Operators one in another in the deepest expression of each query.
    deepest: Vec<usize>,
    query_count: usize,
    /// Words of IS DISTINCT FROM that were just read: no tables come after that.
    compared: usize,
}

impl Depths {
    fn take(&mut self, token: &Token) {
        match token {
            Token::Word(word) => self.word(word.keyword),
            Token::LParen | Token::LBrace => self.open(false),
            Token::LBracket => {
                self.operator();
                self.open(false);
            }
            Token::RParen | Token::RBrace | Token::RBracket => self.close(),
            Token::Comma => {
                self.query_count += usize::from(self.now.is_from);
                self.next_expression();
            }
            Token::VerticalBarRightAngleBracket => self.query_count += 1,
            Token::Whitespace(_)
            | Token::Number(..)
            | Token::SingleQuotedString(_)
            | Token::Period
            | Token::SemiColon
            | Token::EOF => {}
            _ => self.operator(),
        }
    }

    fn word(&mut self, keyword: Keyword) {
        self.compared = match (keyword, self.compared) {
            (Keyword::IS, _) | (Keyword::NOT, 1) => 1,
            (Keyword::DISTINCT, 1) => 2,
            (Keyword::FROM, 2) => 3,
            _ => 0,
        };
        match keyword {
            Keyword::SELECT => {
                self.query_count += 1;
                self.deepest.push(0);
                self.now = Level {
                    query: self.deepest.len() - 1,
                    is_case: self.now.is_case,
                    ..Level::default()
                };
            }
            Keyword::VALUES
            | Keyword::JOIN
            | Keyword::UNION
            | Keyword::EXCEPT
            | Keyword::INTERSECT
            | Keyword::PIVOT
            | Keyword::UNPIVOT => self.query_count += 1,
            Keyword::FROM => self.now.is_from |= self.compared != 3,
            Keyword::GROUP | Keyword::ORDER | Keyword::LIMIT => self.now.is_from = false,
            Keyword::WHERE | Keyword::HAVING => {
                self.now.is_from = false;
                self.next_expression();
            }
            Keyword::ON => self.next_expression(),
            Keyword::CASE => self.open(true),
            Keyword::WHEN | Keyword::THEN | Keyword::ELSE if self.now.is_case => {
                self.next_expression();
            }
            Keyword::END if self.now.is_case => self.leave(),
            Keyword::STRUCT | Keyword::MAP | Keyword::TUPLE => self.now.has_type = true,
            operator if is_operator(operator) => self.operator(),
            _ => {}
        }
    }

    fn operator(&mut self) {
        self.now.depth += 1;
        let deepest = &mut self.deepest[self.now.query];
        *deepest = self.now.depth.max(*deepest);
    }

    fn next_expression(&mut self) {
        if !self.now.has_type {
            self.now.depth = self.now.around;
        }
    }

    fn open(&mut self, is_case: bool) {
        self.outer.push(self.now);
        self.now = Level {
            query: self.now.query,
            around: self.now.depth,
            depth: self.now.depth,
            is_case,
            ..Level::default()
        };
    }

    /// A bracket ends what is between it and the one before: a CASE without an END was the name of something.
    fn close(&mut self) {
        while self.now.is_case && !self.outer.is_empty() {
            self.leave();
        }
        self.leave();
    }

    fn leave(&mut self) {
        self.now = self.outer.pop().unwrap_or(self.now);
    }
}

/// Is a word an operator, as the parser has them?
fn is_operator(word: Keyword) -> bool {
    matches!(
        word,
        Keyword::AND
            | Keyword::OR
            | Keyword::XOR
            | Keyword::NOT
            | Keyword::IS
            | Keyword::IN
            | Keyword::BETWEEN
            | Keyword::OVERLAPS
            | Keyword::LIKE
            | Keyword::ILIKE
            | Keyword::RLIKE
            | Keyword::REGEXP
            | Keyword::MATCH
            | Keyword::SIMILAR
            | Keyword::MEMBER
            | Keyword::OPERATOR
            | Keyword::DIV
            | Keyword::AT
            | Keyword::COLLATE
            | Keyword::NOTNULL
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn many(count: usize, part: impl Fn(usize) -> String, between: &str) -> String {
        (0..count).map(part).collect::<Vec<_>>().join(between)
    }

    #[test]
    fn chains_that_are_as_deep_as_they_are_long_are_refused() {
        let ones = |between: &str| format!("SELECT {}", many(2000, |_| "1".into(), between));
        let case = " + CASE WHEN a THEN 1 ELSE 2 END + ";
        let chained = |at: usize| format!("c{} AS (SELECT a FROM c{at})", at + 1);
        let sums = |at: usize| {
            format!(
                "c{} AS (SELECT a{} AS a FROM c{at})",
                at + 1,
                " + 1".repeat(20)
            )
        };
        for text in [
            ones(" + "),
            ones(" OR "),
            ones(" || "),
            ones(" IS DISTINCT FROM "),
            ones(case),
            ones(" + [1, 2][1] + "),
            ones(" + f(1, 2) + "),
            format!("SELECT a{}", "::int".repeat(2000)),
            format!("SELECT a{}", "::struct<a int, b int>".repeat(2000)),
            format!("SELECT a{}", " IS NULL".repeat(2000)),
            format!("SELECT a{}", " COLLATE c".repeat(2000)),
            format!("SELECT a{}", "[1]".repeat(2000)),
            many(2000, |_| "SELECT 1".into(), " UNION ALL "),
            many(2000, |_| "FROM t".into(), " UNION ALL "),
            format!("SELECT 1 FROM {}", many(2000, |at| format!("t{at}"), ", ")),
            format!("SELECT 1 FROM t{}", " JOIN t USING (a)".repeat(2000)),
            format!("SELECT a IS NULL FROM t{}", ", t".repeat(2000)),
            format!("SELECT DISTINCT FROM t{}", ", t".repeat(2000)),
            format!("FROM t{}", " |> WHERE a".repeat(2000)),
            format!("WITH {} SELECT 1", many(2000, chained, ", ")),
            format!("WITH {} SELECT 1", many(60, sums, ", ")),
            format!("SELECT ({}) + 1", many(2000, |_| "1".into(), " - ")),
        ] {
            let start: String = text.chars().take(60).collect();
            assert!(check(&text).is_err(), "{start}");
        }
    }

    #[test]
    fn what_is_wide_and_not_deep_is_taken() {
        let branch = |at: usize| format!("WHEN code = {at} AND kind = 'x' THEN {at} * 2");
        for text in [
            format!(
                "SELECT {}",
                many(3000, |at| format!("a + {at} AS b{at}"), ", ")
            ),
            format!(
                "SELECT 1 WHERE a IN ({})",
                many(3000, |at| at.to_string(), ", ")
            ),
            format!("SELECT CASE {} END FROM t", many(1000, branch, " ")),
            format!("VALUES {}", many(3000, |at| format!("({at}, -{at})"), ", ")),
            format!(
                "SELECT 1 WHERE {}",
                many(200, |at| format!("a = {at}"), " OR ")
            ),
            many(
                80,
                |at| format!("SELECT a - b FROM t{at} WHERE a > 1"),
                " UNION ALL ",
            ),
            format!("SELECT {}1{}", "(".repeat(3000), ")".repeat(3000)),
            format!("SELECT a IS NOT DISTINCT FROM b{}", ", c".repeat(1000)),
            "SELECT 'it ends nowhere".to_owned(),
        ] {
            let start: String = text.chars().take(60).collect();
            assert_eq!(check(&text), Ok(()), "{start}");
        }
    }
}
