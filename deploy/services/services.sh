#!/usr/bin/env bash
# The real servers that tests and the local cluster use, each installed in its own folder, on its own port of 127.0.0.1.
#   deploy/services/services.sh install [NAME...]   fetch what is missing
#   deploy/services/services.sh start [NAME...]     start and wait until they answer; running ones are left alone
#   deploy/services/services.sh stop [NAME...]
#   deploy/services/services.sh status [NAME...]    exit code 0 only when all of them run
#   deploy/services/services.sh env [NAME...]       the settings that reach them, as `export` lines (secrets included)
# Names: kafka postgis s3 hdfs prometheus; without a name all of them. Folders and ports: README.md.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
all=(postgis kafka s3 hdfs prometheus)

verb=${1:-}
case $verb in
install | start | stop | status | env) shift ;;
*)
    sed -n '2,8s/^# \?//p' "${BASH_SOURCE[0]}" >&2
    exit 2
    ;;
esac
names=("$@")
if [ ${#names[@]} = 0 ]; then names=("${all[@]}"); fi
for name in "${names[@]}"; do
    case " ${all[*]} " in
    *" $name "*) ;;
    *)
        echo "services: no service is called $name; there are: ${all[*]}" >&2
        exit 2
        ;;
    esac
done

failed=0
if [ "$verb" = start ] || [ "$verb" = stop ]; then
    # They do not need each other, so they start together.
    children=()
    for name in "${names[@]}"; do
        "$here/$name.sh" "$verb" &
        children+=($!)
    done
    for child in "${children[@]}"; do wait "$child" || failed=1; done
else
    for name in "${names[@]}"; do "$here/$name.sh" "$verb" || failed=1; done
fi
exit $failed
