//! What every home of observations does: the same tests over all of them.

mod asking;
mod storing;

use contract::observation::Observation;
use observations::{Filter, ObservationStore};

use crate::homes::Home;

/// The suite for every home: a test a line.
macro_rules! suite {
    ($($part:ident::$name:ident),* $(,)?) => {
        mod files {
            $(#[tokio::test(flavor = "multi_thread")]
            async fn $name() {
                super::$part::$name(&super::Home::files()).await;
            })*
        }
        mod postgis {
            $(#[tokio::test(flavor = "multi_thread")]
            async fn $name() {
                let home = super::Home::postgis();
                super::$part::$name(&home).await;
                home.close().await;
            })*
        }
    };
}

suite! {
    storing::storing_twice_changes_nothing,
    storing::a_new_value_replaces_the_old_one,
    storing::one_bad_observation_stops_all_of_its_call,
    storing::every_instant_comes_back_to_the_millisecond,
    storing::every_number_comes_back_with_all_of_its_bits,
    storing::many_writers_at_once_lose_nothing,
    storing::a_hundred_thousand_rows_are_stored_and_found,
    asking::rows_come_by_time_and_then_by_the_bytes_of_their_names,
    asking::pages_join_to_the_whole,
    asking::the_date_line_cuts_nothing,
    asking::edges_of_a_polygon_belong_to_it_and_those_of_its_hole_too,
    asking::a_filter_finds_what_it_names_and_nothing_else,
    asking::platforms_are_summed_up_over_what_is_wanted,
    asking::every_dataset_is_named_however_many_platforms_others_have,
    asking::a_track_has_one_place_for_each_time,
    asking::a_long_track_is_thinned_and_ends_where_it_ends,
    asking::questions_beyond_their_limits_are_refused,
    asking::an_empty_home_is_ready_and_answers_with_nothing,
}

pub(crate) async fn all(store: &dyn ObservationStore, filter: Filter) -> Vec<Observation> {
    let page = store.query(&filter).await.unwrap();
    assert!(page.next.is_none(), "more than one page");
    page.observations
}

pub(crate) async fn values(store: &dyn ObservationStore, filter: Filter) -> Vec<f64> {
    all(store, filter).await.iter().map(|o| o.value).collect()
}
