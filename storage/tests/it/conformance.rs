//! The suite on every store: one test for each pair, so that a failure names both.

/// A module of tests for each store.
macro_rules! on_every_store {
    ($($name:ident),* $(,)?) => {
        on_every_store!(@folder $($name)*);
        on_every_store!(@memory $($name)*);
        on_every_store!(@s3 $($name)*);
        on_every_store!(@hdfs $($name)*);
    };
    (@$store:ident $($name:ident)*) => {
        mod $store {
            $(
                #[tokio::test(flavor = "multi_thread")]
                async fn $name() {
                    let opened = crate::stores::$store();
                    crate::suite::$name(&opened.store).await;
                    opened.clear().await;
                }
            )*
        }
    };
}

on_every_store!(
    one_of_many_writers_creates_an_object,
    writers_of_equal_content_agree,
    two_writers_race_for_one_manifest_number,
    no_exchange_of_many_writers_is_lost,
    a_listing_of_2500_keys_is_whole_and_sorted,
    parts_of_an_object_are_read,
    large_objects_come_back_as_they_went,
    every_allowed_sign_may_stand_in_a_key,
    an_object_may_be_empty,
    grids_and_manifests_round_trip,
    a_removed_object_is_gone_with_its_folder,
    a_probe_finds_the_store_usable_and_leaves_nothing,
    scans_find_objects_by_address,
);
