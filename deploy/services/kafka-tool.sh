#!/usr/bin/env bash
# Kafka's own command-line clients, from the jars that services.sh installs; --bootstrap-server is added when not given.
#   deploy/services/kafka-tool.sh topics --list
#   deploy/services/kafka-tool.sh console-producer --topic granule.notice < notices.jsonl
#   deploy/services/kafka-tool.sh console-consumer --topic granule.landed --from-beginning
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
# shellcheck source=java.sh
source "$here/java.sh"

tool=${1:-}
case $tool in
console-producer) class=ConsoleProducer ;;
console-consumer) class=consumer.ConsoleConsumer ;;
topics) class=TopicCommand ;;
configs) class=ConfigCommand ;;
consumer-groups) class=consumer.group.ConsumerGroupCommand ;;
get-offsets) class=GetOffsetShell ;;
broker-api-versions) class=BrokerApiVersionsCommand ;;
*)
    sed -n '3,5p' "${BASH_SOURCE[0]}" >&2
    echo 'tools: console-producer console-consumer topics configs consumer-groups get-offsets broker-api-versions' >&2
    exit 2
    ;;
esac
shift
case $tool in
configs) class=kafka.admin.$class ;;
*) class=org.apache.kafka.tools.$class ;;
esac

jars=${FLUXGLOBE_SERVICES:-$HOME/.cache/fluxglobe/services}/kafka/lib
[ -d "$jars" ] || {
    echo 'kafka-tool: not installed; run: deploy/services/services.sh install kafka' >&2
    exit 1
}
server=(--bootstrap-server "${FLUXGLOBE_KAFKA:-127.0.0.1:${FLUXGLOBE_KAFKA_PORT:-19092}}")
for argument in "$@"; do
    if [ "$argument" = --bootstrap-server ]; then server=(); fi
done
java=$(find_java) || {
    echo 'no Java 17' >&2
    exit 1
}
exec "$java" -Xmx256m "${small_java[@]}" -Dfluxglobe.log=WARN \
    "-Dlog4j2.configurationFile=$here/kafka/log4j2.xml" -cp "$jars/*" "$class" "${server[@]}" "$@"
