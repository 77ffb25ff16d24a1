#!/usr/bin/env bash
# One HDFS mini-cluster (Hadoop's own: a name node and a data node in one process) on 127.0.0.1, its jars from Maven Central.
#   deploy/services/hdfs.sh install | start | stop | status | env
# FLUXGLOBE_HDFS_PORT (18020): hdfs:// clients; FLUXGLOBE_HDFS_HTTP_PORT (18070): WebHDFS and the name node's pages.
# shellcheck source=process.sh
source "$(dirname "${BASH_SOURCE[0]}")/process.sh"
# shellcheck source=java.sh
source "$here/java.sh"

port=${FLUXGLOBE_HDFS_PORT:-18020}
check_port FLUXGLOBE_HDFS_PORT "$port"
http_port=${FLUXGLOBE_HDFS_HTTP_PORT:-18070}
check_port FLUXGLOBE_HDFS_HTTP_PORT "$http_port"
heap=${FLUXGLOBE_HDFS_HEAP:-320m}

install_service() {
    command -v curl >/dev/null || need_package curl /usr/bin/curl
    fetch_jars "$here/hdfs/pom.xml"
    say "installed in $service"
}

launch_cluster() {
    local java format=()
    java=$(find_java) || fail 'no Java 17'
    # Formats once; an interrupted first start leaves no mark and is formatted again.
    if ! [ -e "$run/formatted" ]; then
        say 'formatting its data folder'
        format=(-format)
    fi
    # Hadoop needs an address for the machine's own name, which not every container has, and no other names.
    printf '127.0.0.1 localhost %s\n' "$HOSTNAME" >"$run/hosts"
    launch "$java" "-Xmx$heap" "${small_java[@]}" \
        -Djava.net.preferIPv4Stack=true "-Djdk.net.hosts.file=$run/hosts" -Dfluxglobe.log=INFO \
        "-Dlog4j.configuration=file:$here/hdfs/log4j.properties" \
        -cp "$service/lib/*" org.apache.hadoop.test.MiniDFSClusterManager "${format[@]}" \
        -datanodes 1 -nnport "$port" -httpport "$http_port" \
        -D "hdfs.minidfs.basedir=$run/data" -D dfs.replication=1 -D dfs.webhdfs.enabled=true \
        -D dfs.namenode.safemode.extension=0 -D dfs.heartbeat.interval=1 -D dfs.namenode.heartbeat.recheck-interval=2000
}

# Out of safe mode, a data node registered, and the file system answers.
cluster_answers() {
    local state
    state=$(curl --silent --fail --max-time 3 "http://127.0.0.1:$http_port/jmx?qry=Hadoop:service=NameNode,name=FSNamesystemState")
    [[ $state == *'"FSState" : "Operational"'* && $state == *'"NumLiveDataNodes" : 1'* ]] &&
        curl --silent --fail --max-time 3 "http://127.0.0.1:$http_port/webhdfs/v1/?op=GETFILESTATUS"
}

start_service() {
    start_once launch_cluster cluster_answers "$port" "$http_port"
    : >"$run/formatted"
}
stop_service() { stop_with TERM; }
status_service() { status_line "127.0.0.1:$port"; }
env_service() {
    printf 'export FLUXGLOBE_HDFS=hdfs://127.0.0.1:%s\n' "$port"
    printf 'export FLUXGLOBE_WEBHDFS=http://127.0.0.1:%s/webhdfs/v1\n' "$http_port"
}

main "$@"
