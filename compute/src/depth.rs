//! How deep what is asked would be: the text of a question or an expression in; a refusal out where what reads, plans and answers it would need
//! more of a thread's stack than there is.
//!
//! The parser counts brackets in most brackets, but for types, patterns and EXPLAIN. What stands in a chain (`a + b + c`, `a OR b OR c`, tables that are joined, queries that read the one
//! before) has no brackets and is as deep: a thread whose stack overflows ends the process, with all that others asked of it.

use datafusion::sql::sqlparser::dialect::GenericDialect;
use datafusion::sql::sqlparser::keywords::Keyword;
use datafusion::sql::sqlparser::tokenizer::{Token, Tokenizer};

/// Most operators one in another, of all queries of a question together: with 2 MiB of stack, as a thread has, 1200 are planned and 1500 are not.
const MAX_OPERATORS: usize = 500;
/// Most queries, joins and tables: 500 that read each other are planned, 800 overflow the same stack.
const MAX_QUERIES: usize = 200;
/// Most brackets one in another; the parser itself takes 50 of expressions.
const MAX_BRACKETS: usize = 100;
/// Most brackets one in another after words that the parser reads in two ways or four, one after the other: each doubles or quadruples the time
/// of a text that it cannot read. 14 of POSITION take 6 s.
const MAX_TRIED: usize = 10;
/// Most EXPLAINs: the planner takes one, and 700 overflow a thread's stack before it is asked.
const MAX_EXPLAINS: usize = 8;

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
    if depths.is_endless {
        return Err(format!(
            "it has more than {MAX_BRACKETS} brackets one in another, {MAX_TRIED} of CAST, POSITION and the like, or {MAX_EXPLAINS} EXPLAIN, or an \
             INTERVAL of an INTERVAL: ask in parts"
        ));
    }
    if depths.query_count > MAX_QUERIES {
        return Err(format!(
            "it has more than {MAX_QUERIES} queries, joins and tables: ask for fewer at a time"
        ));
    }
    if depths.most_operators() > MAX_OPERATORS {
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
    /// Brackets around it of what the parser reads in several ways.
    tried: usize,
    /// The first query of the branch of a UNION that is being read.
    branch: Option<usize>,
    /// Operators of the branch before that has most: branches are beside each other.
    widest: usize,
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
    /// The word before, if nothing else came since.
    last: Option<Keyword>,
    explain_count: usize,
    /// Would it take the parser more stack or time than there is?
    is_endless: bool,
}

impl Depths {
    fn take(&mut self, token: &Token) {
        let last = self.last;
        if !matches!(token, Token::Whitespace(_)) {
            self.last = match token {
                Token::Word(word) => Some(word.keyword),
                _ => None,
            };
        }
        match token {
            Token::Word(word) => {
                self.is_endless |=
                    word.keyword == Keyword::INTERVAL && last == Some(Keyword::INTERVAL);
                self.word(word.keyword);
            }
            Token::LParen | Token::LBrace => self.open_after(last),
            Token::LBracket => {
                self.operator();
                self.open_after(last);
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
                self.begin_query();
            }
            Keyword::UNION | Keyword::EXCEPT | Keyword::INTERSECT => {
                self.query_count += 1;
                self.end_branch();
            }
            Keyword::EXPLAIN | Keyword::DESCRIBE => {
                self.explain_count += 1;
                self.is_endless |= self.explain_count > MAX_EXPLAINS;
            }
            Keyword::VALUES | Keyword::JOIN | Keyword::PIVOT | Keyword::UNPIVOT => {
                self.query_count += 1;
            }
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

    fn begin_query(&mut self) {
        self.deepest.push(0);
        let query = self.deepest.len() - 1;
        self.now = Level {
            query,
            is_case: self.now.is_case,
            tried: self.now.tried,
            branch: Some(self.now.branch.unwrap_or(query)),
            widest: self.now.widest,
            ..Level::default()
        };
    }

    /// What comes next is beside the branch before, not within. Queries of WITH, which stand before the first SELECT, are of all branches.
    fn end_branch(&mut self) {
        if let Some(start) = self.now.branch.take() {
            self.now.widest = self.widest_since(start);
            self.deepest.truncate(start);
        }
        self.begin_query();
    }

    /// Operators of the branch of this level that has most, the one that began there among them.
    fn widest_since(&self, start: usize) -> usize {
        self.now.widest.max(self.deepest[start..].iter().sum())
    }

    /// Operators that may come to stand one in another.
    fn most_operators(mut self) -> usize {
        while !self.outer.is_empty() {
            self.leave();
        }
        let start = self.now.branch.unwrap_or(self.deepest.len());
        self.deepest[..start].iter().sum::<usize>() + self.widest_since(start)
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

    fn open_after(&mut self, word: Option<Keyword>) {
        self.open(false);
        self.now.tried += usize::from(word.is_some_and(is_tried));
        self.is_endless |= self.now.tried > MAX_TRIED;
    }

    fn open(&mut self, is_case: bool) {
        self.outer.push(self.now);
        self.is_endless |= self.outer.len() > MAX_BRACKETS;
        self.now = Level {
            query: self.now.query,
            around: self.now.depth,
            depth: self.now.depth,
            is_case,
            tried: self.now.tried,
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
        let Some(outer) = self.outer.pop() else {
            return;
        };
        if let Some(start) = self.now.branch {
            let all = self.widest_since(start);
            self.deepest.truncate(start);
            self.deepest.push(all);
        }
        self.now = outer;
    }
}

/// Does the parser read what stands in brackets after a word in one way after the other?
fn is_tried(word: Keyword) -> bool {
    matches!(
        word,
        Keyword::CAST
            | Keyword::TRY_CAST
            | Keyword::SAFE_CAST
            | Keyword::CONVERT
            | Keyword::TRY_CONVERT
            | Keyword::POSITION
            | Keyword::SUBSTRING
            | Keyword::SUBSTR
            | Keyword::OVERLAY
            | Keyword::CEIL
            | Keyword::FLOOR
            | Keyword::EXTRACT
            | Keyword::TRIM
            | Keyword::ARRAY
            | Keyword::INTERVAL
    )
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
            format!("SELECT {}1{}", "(".repeat(3000), ")".repeat(3000)),
            format!("{}SELECT 1", "EXPLAIN ".repeat(700)),
            format!("SELECT {}'1' DAY", "INTERVAL ".repeat(400)),
            format!(
                "SELECT CAST(1 AS {}INT{})",
                "NULLABLE(".repeat(1600),
                ")".repeat(1600)
            ),
            format!(
                "SELECT 1 FROM t MATCH_RECOGNIZE(PATTERN({}a",
                "(".repeat(3000)
            ),
            // Each of these doubles the time that the parser takes to say what is wrong.
            format!("SELECT {}1{}", "CAST(".repeat(20), " AS)".repeat(20)),
            format!("SELECT {}{}", "position(".repeat(20), " )(*".repeat(20)),
            format!("SELECT {}1", "ARRAY[".repeat(20)),
            // Of a UNION the largest branch counts, with what stands in a WITH before.
            format!(
                "WITH c AS (SELECT 1{}) SELECT a{} FROM c UNION SELECT 1 FROM c",
                " + 1".repeat(300),
                " + 1".repeat(300)
            ),
            format!(
                "WITH c AS (SELECT 1{}) SELECT 1 FROM c UNION (SELECT a{} FROM (SELECT 2) UNION SELECT 1 FROM c)",
                " + 1".repeat(300),
                " + 1".repeat(300)
            ),
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
            many(
                50,
                |at| {
                    format!(
                        "SELECT 'p{at}', avg(v) FROM p{at} WHERE a > 1 AND b < 2 AND c >= 3 AND d <= 4 AND e <> 5 AND f = 6"
                    )
                },
                " UNION ALL ",
            ),
            "SELECT 1) UNION SELECT 2".to_owned(),
            format!("SELECT {}1{}", "CAST(".repeat(8), " AS INT)".repeat(8)),
            "EXPLAIN SELECT INTERVAL '1' DAY + INTERVAL '2' DAY".to_owned(),
            format!("SELECT {}1{}", "(".repeat(40), ")".repeat(40)),
            format!("SELECT a IS NOT DISTINCT FROM b{}", ", c".repeat(1000)),
            "SELECT 'it ends nowhere".to_owned(),
        ] {
            let start: String = text.chars().take(60).collect();
            assert_eq!(check(&text), Ok(()), "{start}");
        }
    }
}
